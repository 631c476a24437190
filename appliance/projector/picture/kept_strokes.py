"""Kept strokes: a sheet of paper that keeps an evening's strokes, wet ones, then stains that dry slowly."""

from __future__ import annotations

from collections.abc import Callable

import moderngl

from appliance.projector.picture.scene import Easel
from appliance.projector.picture.targets import Target, of_lines

LINES = 400  # the height of the sheet
STEP_S = 0.4  # strokes are laid onto it so often
WET, STAIN = 0.6, 0.2  # how much of a stroke it takes; strokes over each other make no darker one
WET_LOSS = 4  # shades that a step takes: wet strokes are gone after 15 s
STAIN_STEPS = 60  # steps that take one shade of a stain: stains are gone after 20 minutes
SHADES = 255.0
_LESS = moderngl.FUNC_REVERSE_SUBTRACT, moderngl.FUNC_REVERSE_SUBTRACT


class KeptStrokes:
    """The sheet: red is wet, green the stain. Its state follows the dance's time in steps of STEP_S, whatever
    the rate of pictures; a time that goes back starts a blank one."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._dry = easel.drawing("screen", "dry")
        self._sheet: Target | None = None
        self._step = 0

    def at(self, time_s: float, aspect: float, lay: Callable[[Target, float], None] | None) -> Target:
        """The sheet at this time. lay: draws the strokes of now, as strong as the number says, into a target;
        None: nothing is kept, the sheet is blank."""
        sheet = self._easel.canvas("kept", of_lines(LINES, aspect))
        step = int(time_s // STEP_S)
        if sheet is not self._sheet or lay is None or step < self._step:
            sheet.start()
            self._sheet, self._step = sheet, step
        if lay is None or step == self._step:
            return sheet
        sheet.use()
        ctx = self._easel.ctx
        ctx.enable_only(moderngl.BLEND)
        ctx.blend_func, ctx.blend_equation = (moderngl.ONE, moderngl.ONE), _LESS
        wet = min(1.0, WET_LOSS * (step - self._step) / SHADES)
        stain = min(1.0, (step // STAIN_STEPS - self._step // STAIN_STEPS) / SHADES)
        self._dry.draw({"loss": (wet, stain, 0.0, 0.0)})
        ctx.blend_equation = moderngl.MAX, moderngl.MAX
        for channel, strength in (("r", WET), ("g", STAIN)):
            sheet.keep(channel)
            lay(sheet, strength)
        sheet.keep("rgba")
        ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        self._step = step
        return sheet

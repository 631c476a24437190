"""Scene: one moment seen by the camera, in figure heights, and what all looks draw it with."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from appliance.body.mesh_file import mesh_of_show
from appliance.body.rest_pose import anatomy_of
from appliance.body.skinning import BodyMesh
from appliance.outputs.coupling import coupled, led_by
from appliance.outputs.joint_frame import Floats
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.projector.picture.body_buffers import BodyBuffers, Content
from appliance.projector.picture.camera import View
from appliance.projector.picture.drawing import Drawing
from appliance.projector.picture.image_file import read_image, texture_of
from appliance.projector.picture.melting import Melting
from appliance.projector.picture.noise import SIDE, noise_pixels
from appliance.projector.picture.poses import HoldTexture, Poses, PoseTexture
from appliance.projector.picture.targets import Target
from appliance.projector.picture.vertices import layout, packed
from appliance.projector.picture.video import Video
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig
from appliance.show.section import MOST_PUPPETS

BACKDROP = "BACKDROP"  # the part of a look's last step that has an image behind the figure
Box = tuple[float, float, float, float]
WHOLE: Box = (0.0, 0.0, 1.0, 1.0)
WIDER, SPREAD_STEP, MOST_SPREAD = 1.2, 0.5, 5.0  # in a figure height from the middle; of `spread`
KEY_FROM, KEY_ABOVE = -0.9, 40.0  # radians beside the camera, degrees above the floor
SHUTTER = 0.5  # rows of poses for which the shutter is open: 12 ms
MOST_MOMENTS, BLUR_STEP = 4, 5.0  # pixels from one moment to the next
TIME_ROUND_S = 1000.0  # shaders' time begins anew: all that drifts, runs or sways comes round in it
MELT_STEPS = 2  # towards a molten surface; one where nobody looks closely
MELT_ROUND_S = 20.0 * math.pi  # the same for the waves of a molten surface
FLESH = 0.16  # figure heights that the surface reaches beyond the joints at most
LUMP = 0.2  # and a wholly amorphous one beyond that


@dataclass(frozen=True)
class Scene:
    """A moment of the dance as the camera sees it; time_s drives haze and dust.

    melt: how amorphous figures are, 0 to 1."""

    time_s: float
    view: View
    poses: Poses
    aspect: float
    melt: float = 0.0

    @cached_property
    def inputs(self) -> dict[str, Any]:
        """The shaders' inputs about the moment and the camera."""
        view = self.view
        return {
            "projection": view.projection,
            "eye": view.eye,
            "axes": np.stack([view.right, view.up, view.back], axis=1),
            "slopes": view.slopes,
            "ground": view.ground,
            "spread": self.spread,
            "stands": self._stands,
            "aspect": self.aspect,
            "time": self.time_s % TIME_ROUND_S,
            "time_round": TIME_ROUND_S,
        }

    @property
    def _stands(self) -> list[tuple[float, float]]:
        """x and z of where MOST_PUPPETS figures are; the last ones repeat the first."""
        x, z = self.view.ground.tolist()
        stands = [(x, z)]
        if self.poses.figures > 1:
            stands = [(float(x), float(z)) for x, _, z in self.poses.each_root[0]]
        return (stands + [stands[0]] * MOST_PUPPETS)[:MOST_PUPPETS]

    @cached_property
    def spread(self) -> float:
        """How much larger than around one figure the lit floor and the shadow's pictures are, in steps."""
        return min(SPREAD_STEP * math.ceil(self.poses.apart * WIDER / SPREAD_STEP) + 1.0, MOST_SPREAD)

    @property
    def distance(self) -> float:
        """From the eye to the dancer's middle, figure heights."""
        return float(np.linalg.norm(self.view.eye - [self.view.ground[0], 0.5, self.view.ground[1]]))

    @property
    def share_of_picture(self) -> float:
        """Share of the picture's height that a figure height takes where the dancer is."""
        return 0.5 / (self.view.slopes[1] * self.distance)

    @property
    def lamp(self) -> Array:
        """A unit vector towards the key light."""
        return direction(self.view.azimuth + KEY_FROM, KEY_ABOVE)

    def pixel_height(self, lines: int) -> float:
        """Figure heights that one of a picture's lines takes where the dancer is."""
        return 1.0 / (self.share_of_picture * lines)

    def shutter(self, wall: Wall) -> list[float]:
        """`back` of the moments that make one picture: more where a joint moves by many pixels, and where the
        machine draws several samples anyway."""
        if not wall.detail.samples:
            return [0.0]
        way = np.linalg.norm(self.poses.positions[1] - self.poses.positions[0], axis=1).max()
        pixels = SHUTTER * float(way) * self.share_of_picture * wall.picture[1]
        count = min(MOST_MOMENTS, max(1, round(pixels / BLUR_STEP)))
        return [SHUTTER * moment / count for moment in range(count)]

    def box(self, rows: int = 1, margin: float = 0.0) -> Box:
        """Where the figure is in the picture, or has been in the last `rows` of its poses: left, lower, right
        and upper edge, 0..1; margin: around it, of the picture's height."""
        places = self.poses.positions[:rows].reshape(-1, 3).astype(float)
        x, y, _, w = self.view.projection @ np.concatenate([places, np.ones((len(places), 1))], axis=1).T
        flesh = 0.5 * (FLESH + LUMP * self.melt) / (np.abs(w) * np.array(self.view.slopes)[:, None])
        across, up = 0.5 + 0.5 * x / w, 0.5 + 0.5 * y / w
        low, high = np.stack([across, up]) - flesh, np.stack([across, up]) + flesh
        around = np.array([margin / self.aspect, margin])
        edges = np.concatenate([low.min(axis=1) - around, high.max(axis=1) + around])
        left, lower, right, upper = np.clip(edges, 0.0, 1.0).tolist()
        return left, lower, right, upper


class _FigureTextures:
    """The pose of one figure, on the GPU."""

    def __init__(self, ctx: moderngl.Context, mesh: BodyMesh, joints: int) -> None:
        self.poses = PoseTexture(ctx, mesh, joints)
        self.holds, self.led = HoldTexture(ctx, joints), HoldTexture(ctx, joints)
        self.inputs = {"poses": self.poses.texture, "holds": self.holds.texture, "led": self.led.texture}

    def release(self) -> None:
        self.poses.release()
        self.holds.release()
        self.led.release()


class Easel:
    """The body, its poses, the noise and the canvases: once on the GPU, for all looks.

    show: the folder with the body's surface; None: it is modelled here. melts: some look does.
    """

    def __init__(
        self, ctx: moderngl.Context, skeleton: Skeleton, show: Path | None = None, melts: bool = False
    ) -> None:
        self.ctx, self.skeleton = ctx, skeleton
        mesh = mesh_of_show(skeleton, show)
        self.height = mesh.height
        self.sole = float(mesh.bind_positions[:, 1].min() - mesh.vertices[:, 1].min())
        self.bind_positions = mesh.bind_positions / mesh.height
        self.body = BodyBuffers(ctx, mesh, melts)
        self._figures = [_FigureTextures(ctx, mesh, len(skeleton))]
        self._mesh, self._shown = mesh, 1
        self._coupled = HoldTexture(ctx, len(skeleton))
        self._poses: Sequence[Poses] = ()
        self._holds: Sequence[Floats | None] = ()
        self.noise = ctx.texture((SIDE, SIDE), 4, noise_pixels())
        self.noise.build_mipmaps()
        self.noise.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        self._backdrops: dict[str, moderngl.Texture] = {}
        self._videos: dict[str, Video] = {}
        self._canvases: dict[str, Target] = {}
        self._buffers: list[moderngl.Buffer] = []
        self._tables: list[moderngl.Texture] = []
        self._drawings: list[Drawing] = []
        self._melting = Melting(mesh, anatomy_of(skeleton)) if melts else None
        self._melt, self._molten = dict[str, Any](), dict[tuple[int, int], dict[str, Any]]()
        self.melt(0.0, 0.0)
        self._sheets: dict[tuple[str, ...], Drawing] = {}
        self._expose = self.drawing("screen", "expose")

    def show(self, poses: Sequence[Poses], holds: Sequence[Floats | None]) -> None:
        """The poses of the next picture's figures, at least one."""
        self._shown, self._poses, self._holds = len(poses), poses, holds
        self._molten.clear()
        while len(self._figures) < self._shown:
            self._figures.append(_FigureTextures(self.ctx, self._mesh, len(self.skeleton)))
        for textures, one, held in zip(self._figures, poses, holds, strict=False):
            textures.poses.write(one)
            textures.holds.write(held)

    def lead(self) -> list[int | None]:
        """Bring onto the GPU how far joints follow the held one; returns the joint that leads each figure."""
        leaders = []
        for textures, one, held in zip(self._figures, self._poses, self._holds, strict=False):
            leader, led = led_by(one.positions, held)
            textures.led.write(led)
            leaders.append(leader)
        return leaders

    def couplings(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Each pair of figures: the first of them, and the inputs with how alike their joints move. The
        inputs hold until the next pair.
        """
        for first, second in itertools.combinations(range(self._shown), 2):
            self._coupled.write(coupled(self._poses[first].positions, self._poses[second].positions))
            others = self._figures[second].inputs["poses"]
            yield first, {"led": self._coupled.texture, "others": others}

    def melt(self, share: float, time_s: float) -> None:
        """How amorphous figures are from now on, 0 to 1; time_s moves their surface."""
        root = tuple(self.bind_positions[0].tolist())
        self._melt = {"melt": share, "melt_time": time_s % MELT_ROUND_S, "bind_root": root}

    def weigh(self, of: Callable[[Poses], Floats]) -> None:
        """Bring a number of each joint onto the GPU, in place of how far it follows. of: a figure's poses."""
        for textures, one in zip(self._figures, self._poses, strict=False):
            textures.led.write(of(one))

    def draw_figure(self, figure: int, drawing: Drawing, inputs: dict[str, Any], *drawn: int) -> None:
        """Draw what belongs to one of the figures. drawn: as Drawing takes it."""
        molten = self._melt_of(figure, inputs.get("row", 0), 1 if inputs.get("roughly") else MELT_STEPS)
        drawing.draw({"back": 0.0} | self._melt | molten | self._figures[figure].inputs | inputs, *drawn)

    def _melt_of(self, figure: int, row: int, steps: int) -> dict[str, Any]:
        """The shader's inputs for a molten figure in the pose of a row. steps: towards its surface."""
        share = self._melt["melt"]
        if self._melting is None:
            return {}
        if share == 0.0:
            return self._melting.human
        if (figure, row) not in self._molten:
            self._molten[figure, row] = self._melting.bones(self._poses[figure], row, share)
        return self._molten[figure, row] | {"melt_steps": steps}

    def draw_figures(self, drawing: Drawing, inputs: dict[str, Any], *drawn: int) -> None:
        """Draw what belongs to a figure once for each. drawn: as Drawing takes it."""
        for figure in range(self._shown):
            self.draw_figure(figure, drawing, inputs, *drawn)

    def expose(self, picture: Target, moments: Sequence[float], draw: Callable[[float], None]) -> Target:
        """The mean of the pictures that `draw` makes at each moment; draw: takes `back`."""
        if len(moments) == 1:
            draw(moments[0])
            return picture
        exposed = self.canvas("exposed", picture.size)
        exposed.start()
        for back in moments:
            draw(back)
            exposed.use()
            self.ctx.enable_only(moderngl.BLEND)
            self.ctx.blend_func = moderngl.ONE, moderngl.ONE
            self._expose.draw({"source": picture.texture, "part": 1.0 / len(moments)})
        return exposed

    def vertices(self, parts: Mapping[str, Any], instanced: bool = False) -> list[tuple[Any, ...]]:
        """Bring vertices onto the GPU; returns what a vertex array is made of. instanced: one an instance."""
        self._buffers.append(self.ctx.buffer(packed(parts)))
        formats, *names = layout(parts)
        return [(self._buffers[-1], formats + ("/i" if instanced else ""), *names)]

    def table(self, values: Floats) -> moderngl.Texture:
        """Bring (rows, columns, 4) numbers onto the GPU, for shaders that fetch texels."""
        texture = self.ctx.texture(values.shape[1::-1], 4, values.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._tables.append(texture)
        return texture

    def indices(self, values: NDArray[np.int32]) -> moderngl.Buffer:
        """Bring the corners of triangles onto the GPU."""
        self._buffers.append(self.ctx.buffer(values.tobytes()))
        return self._buffers[-1]

    def canvas(self, name: str, size: tuple[int, int], depth: bool = False, samples: int = 0) -> Target:
        """The canvas of that name, replaced when its size has changed."""
        known = self._canvases.get(name)
        if known is None or known.size != size or known.samples != samples:
            if known:
                known.release()
            known = self._canvases[name] = Target(self.ctx, size, depth, samples)
        return known

    def held(self, look: LookConfig) -> dict[str, Any]:
        """The inputs of shaders that mark held joints; `held` 0 switches that off."""
        is_held = any(textures.holds.most > 0.0 for textures in self._figures[: self._shown])
        return {"held": look.held.strength if is_held else 0.0}

    def behind(self, look: LookConfig) -> dict[str, Any]:
        """The inputs of the look's image or video behind the figure, if it has one."""
        if look.video is not None:
            if look.video not in self._videos:
                self._videos[look.video] = Video(self.ctx, look.video)
            return {"backdrop": self._videos[look.video].texture()}
        if look.image is None:
            return {}
        if look.image not in self._backdrops:
            self._backdrops[look.image] = texture_of(self.ctx, read_image(look.image))
        return {"backdrop": self._backdrops[look.image]}

    def picture(self, wall: Wall, look: LookConfig) -> Target:
        """The canvas for the figure, with depth, at a share of the picture's resolution."""
        share = min(1.0, (look.render_scale or wall.detail.scale) * wall.finer)
        width, height = (max(1, round(share * side)) for side in wall.picture)
        samples = min(wall.detail.samples, self.ctx.max_samples)
        return self.canvas("picture", (width, height), depth=True, samples=samples)

    def lay(
        self, fragment: str, wall: Wall, opacity: float, inputs: dict[str, Any], box: Box = WHOLE
    ) -> None:
        """The last step of a look: onto the wall; opacity 1 replaces what was there, less blends over it.

        fragment: names the shader; where it is simpler outside of a box, its part FRAME is drawn there.
        """
        wall.framebuffer.use()
        wall.framebuffer.viewport = (0, 0, *wall.display)
        if opacity == 1.0:
            self.ctx.enable_only(moderngl.NOTHING)
            wall.framebuffer.clear()  # else a GPU that draws in tiles would fetch the previous picture
        else:
            self.ctx.enable_only(moderngl.BLEND)
            self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        inputs |= {
            "clip_from_picture": wall.clip_from_picture,
            "box": box,
            "opacity": opacity,
            "level": wall.level,
            "inverse_gamma": 1.0 / wall.gamma,
        }
        parts = ("GAMMA",) if wall.gamma != 1.0 else ()
        backdrop = inputs.get("backdrop")
        if backdrop is not None:
            across = wall.aspect * backdrop.height / backdrop.width
            inputs["cut"] = (min(1.0, across), min(1.0, 1.0 / across))
            parts = (*parts, BACKDROP)
        self._sheet(fragment, *parts).draw(inputs, moderngl.TRIANGLE_STRIP, 4)
        if box != WHOLE:
            self._sheet(fragment, *parts, "FRAME").draw(inputs, moderngl.TRIANGLE_STRIP, 10)

    def _sheet(self, fragment: str, *parts: str) -> Drawing:
        """Made when it is first needed."""
        key = fragment, *parts
        if key not in self._sheets:
            self._sheets[key] = self.drawing("laid", fragment, parts=parts)
        return self._sheets[key]

    def drawing(
        self,
        vertex: str,
        fragment: str,
        content: Sequence[tuple[Any, ...]] = (),
        index: moderngl.Buffer | None = None,
        parts: Sequence[str] = (),
        molten: Content | None = None,
    ) -> Drawing:
        """A shader program with what it draws, as Drawing takes them; released with the easel."""
        parts = (*parts, "MELT") if self._melting else parts
        self._drawings.append(Drawing(self.ctx, vertex, fragment, content, index, parts, molten))
        return self._drawings[-1]

    def surface(self, vertex: str, fragment: str, coarse: bool = False, parts: Sequence[str] = ()) -> Drawing:
        """The body's surface, drawn by these shaders."""
        molten = None if coarse else self.body.molten
        return self.drawing(vertex, fragment, *self.body.content(coarse), parts, molten)

    def blur(self, blur: Drawing, picture: Target, other: Target, step_uv: tuple[float, float]) -> None:
        """Soften a picture across, into another canvas of its size, and upwards, back into its own."""
        for source, into, step in ((picture, other, (step_uv[0], 0.0)), (other, picture, (0.0, step_uv[1]))):
            into.start()
            blur.draw({"source": source.texture, "step_uv": step})

    def release(self) -> None:
        shared: list[Any] = [self.body, *self._figures, self._coupled, self.noise]
        shared += [*self._canvases.values(), *self._backdrops.values(), *self._videos.values()]
        for owned in (*self._drawings, *self._buffers, *self._tables, *shared):
            owned.release()


def direction(azimuth: float, elevation_deg: float) -> Array:
    """A unit vector towards where a lamp hangs: azimuth in radians from +z to +x, elevation in degrees."""
    elevation = np.radians(elevation_deg)
    flat = np.cos(elevation)
    return np.array([flat * np.sin(azimuth), np.sin(elevation), flat * np.cos(azimuth)])

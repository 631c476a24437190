"""GDTF and MVR files as a test needs them: zip archives with XML laid out after DIN SPEC 15800 and 15801."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

IDENTITY = "{1,0,0}{0,1,0}{0,0,1}"
SIXTEEN_BIT = "Head 16"
EIGHT_BIT = "Head 8"


def archive(files: dict[str, bytes | str]) -> bytes:
    """A zip archive with these files."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in files.items():
            packed.writestr(name, content)
    return stream.getvalue()


def channel(offset: str, geometry: str, functions: str, attribute: str, initial: str = "") -> str:
    """A DMX channel with one logical channel."""
    return (
        f'<DMXChannel DMXBreak="1" Offset="{offset}" Geometry="{geometry}" Highlight="None" '
        f'InitialFunction="{geometry}_{attribute}.{attribute}.{initial or attribute}">'
        f'<LogicalChannel Attribute="{attribute}" Snap="No" Master="None">{functions}</LogicalChannel>'
        "</DMXChannel>"
    )


def function(
    attribute: str,
    physical: tuple[float, float] = (0, 1),
    first: str = "0/1",
    inside: str = "",
    more: str = "",
) -> str:
    """A channel function from the value `first` on."""
    return (
        f'<ChannelFunction Name="{attribute}" Attribute="{attribute}" DMXFrom="{first}" Default="{first}" '
        f'PhysicalFrom="{physical[0]}" PhysicalTo="{physical[1]}" {more}>{inside}</ChannelFunction>'
    )


SHUTTER = channel(
    "6",
    "Beam",
    function(
        "Shutter1",
        inside='<ChannelSet Name="Closed" DMXFrom="0/1" PhysicalFrom="0" PhysicalTo="0"/>'
        '<ChannelSet Name="Open" DMXFrom="32/1" PhysicalFrom="1" PhysicalTo="1"/>',
    )
    + function("Shutter1Strobe", (1, 20), "64/1"),
    "Shutter1",
)


def moving_head(pan: tuple[float, float] = (270, -270), tilt: tuple[float, float] = (-135, 135)) -> str:
    """The description of a head with two modes: pan and tilt in 16 bit with all it has, and a small one."""
    colours = "".join(
        channel(str(7 + place), "Beam", function(f"ColorAdd_{letter}"), f"ColorAdd_{letter}")
        for place, letter in enumerate("RGB")
    )
    sixteen = (
        channel("1,2", "Yoke", function("Pan", pan, "0/2s", more='RealFade="2.5"'), "Pan")
        + channel("3,4", "Head", function("Tilt", tilt), "Tilt")
        + channel("5", "Beam", function("Dimmer"), "Dimmer")
        + SHUTTER
        + colours
        + channel("11", "Beam", function("Gobo1") + function("Gobo1SelectSpin", first="200/1"), "Gobo1")
    )
    eight = (
        channel("1", "Yoke", function("Pan", pan, more='RealFade="2.5"'), "Pan")
        + channel("2", "Head", function("Tilt", tilt), "Tilt")
        + channel("3", "Beam", function("Dimmer"), "Dimmer")
    )
    return fixture(
        f'<DMXMode Name="{SIXTEEN_BIT}" Geometry="Base"><DMXChannels>{sixteen}</DMXChannels></DMXMode>'
        f'<DMXMode Name="{EIGHT_BIT}" Geometry="Base"><DMXChannels>{eight}</DMXChannels></DMXMode>'
    )


def fixture(modes: str, geometries: str = "") -> str:
    """A description with the geometries of a moving head, or others."""
    here = "{1,0,0,0}{0,1,0,0}{0,0,1,-0.2}{0,0,0,1}"
    head = (
        f'<Geometry Name="Base" Position="{here}"><Axis Name="Yoke" Position="{here}">'
        f'<Axis Name="Head" Position="{here}"><Beam Name="Beam" Position="{here}"/></Axis></Axis></Geometry>'
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?><GDTF DataVersion="1.2">'
        '<FixtureType Name="Beam 1" ShortName="B1" LongName="Beam 1" Manufacturer="Testlight" Description="" '
        'FixtureTypeID="8EAC5323-C63A-4C21-96CF-5DBF4AF049B7"><AttributeDefinitions/>'
        f"<Geometries>{geometries or head}</Geometries><DMXModes>{modes}</DMXModes></FixtureType></GDTF>"
    )


def hung(
    name: str, address: str, matrix: str, mode: str = SIXTEEN_BIT, spec: str = "Testlight@Beam 1"
) -> str:
    """A fixture of a rig; matrix: its axes as rows and its origin in millimetres."""
    return (
        f'<Fixture name="{name}" uuid="8EAC5323-C63A-4C21-96CF-000000000001"><Matrix>{matrix}</Matrix>'
        f"<GDTFSpec>{spec}.gdtf</GDTFSpec><GDTFMode>{mode}</GDTFMode><FixtureID>1</FixtureID>"
        f'<Addresses><Address break="0">{address}</Address></Addresses></Fixture>'
    )


def scene(children: str) -> str:
    """A scene with one layer, 1 m above the floor."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?><GeneralSceneDescription verMajor="1" verMinor="6" '
        'provider="test" providerVersion="1"><Scene><Layers><Layer name="Stage" uuid="1">'
        f"<Matrix>{IDENTITY}{{0,0,1000}}</Matrix>"
        f"<ChildList>{children}</ChildList></Layer></Layers></Scene></GeneralSceneDescription>"
    )


def write_gdtf(path: Path, description: str) -> Path:
    """A GDTF file."""
    path.write_bytes(archive({"description.xml": description}))
    return path


def write_mvr(path: Path, children: str) -> Path:
    """An MVR file with this moving head."""
    inside = archive({"description.xml": moving_head()})
    path.write_bytes(
        archive({"GeneralSceneDescription.xml": scene(children), "Testlight@Beam 1.gdtf": inside})
    )
    return path

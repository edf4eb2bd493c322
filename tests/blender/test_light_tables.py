"""Light in a sensor's file: the tables, the entries that are refused, and the record in folders of chunks."""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

pytest.importorskip("bpy")

from perfect_bvh_addon import Beam, Detection, Light, Noise, Optics, load_sensor, sensor_names
from perfect_bvh_addon.scanning import sensor_files
from perfect_bvh_addon.scanning.light.reflectance import TABLES
from perfect_bvh_addon.scanning.piece_scan import light_input

RULES = Path(sensor_files.__file__).parent / "light" / "README.md"
PATTERN = 'kind = "raster"\n'


def test_tables_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        PATTERN
        + """
        [beam]
        divergence = 3
        rays = 7
        returns = 2
        keep = ["strongest", "last"]
        resolution = 0.3
        [light]
        refract = true
        spectrum = [1, 0, 0]
        [detection]
        distances = [10, 100.0]
        reflectivities = [0.01, 0.1]
        [noise]
        range = 0.01
        dropout = 1.0
        bias = -0.5
        """
    )
    assert load_sensor(path).light == Light(
        Beam(3, 7, 2, ("strongest", "last"), 0.3),
        Optics(refract=True, spectrum=(1.0, 0.0, 0.0)),
        Detection((10.0, 100.0), (0.01, 0.1)),
        Noise(range=0.01, dropout=1.0, bias=-0.5),
    )
    path.write_text(f'{PATTERN}[beam]\nkeep = "last"')
    assert load_sensor(path).light == Light(Beam(keep=("last",)))
    path.write_text(PATTERN)
    assert load_sensor(path).light is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[baem]", r"has no 'baem' \(is it 'beam'\?\)"),
        ("beam = 3", r"beam must be a table, \[beam\], got 3"),
        ("[beam]\ndivergense = 3", r"\[beam\] has no 'divergense' \(is it 'divergence'\?\): divergence, rays"),
        ("[beam]\ndivergence = -1", "beam: divergence must be a number from 0 to below 1000, got -1"),
        ("[beam]\ndivergence = nan", "divergence must be a number"),
        ("[beam]\nrays = 0", "rays must be an integer from 1 to 1024"),
        ("[beam]\nrays = 2.5", "rays must be an integer"),
        ("[beam]\nrays = true", r"\[beam\]: rays must be a number, got True"),
        ("[beam]\nrays = 7", "several rays need a resolution above 0"),
        ("[beam]\nreturns = 16", "returns must be an integer from 1 to 15"),
        ("[beam]\nkeep = []", "keep must be some of first, strongest, last"),
        ('[beam]\nkeep = ["first", "first"]', "each once"),
        ('[beam]\nkeep = "frist"', "keep must be some of"),
        ("[beam]\nkeep = 3", "keep must be a list of words"),
        ("[beam]\nresolution = inf", "resolution must be a finite number of at least 0"),
        ("[light]\nrefract = 1", "refract must be true or false"),
        ("[light]\nbounces = -1", "bounces must be an integer from 0"),
        ("[light]\nmirror_roughness = 2", "mirror_roughness must be a number from 0"),
        ("[light]\nspectrum = [1, 2]", "spectrum must be three numbers"),
        ("[light]\nspectrum = [0, 0, 0]", "spectrum must have a number above 0"),
        ("[light]\nspectrum = [1, 2, true]", "spectrum must be a list of numbers"),
        ("[light]\nreference = 0", "reference must be a finite number above 0"),
        ("[detection]\ndistances = [1]", "the same length, got 1 and 0"),
        ("[detection]\ndistances = [2, 2]\nreflectivities = [0, 1]", r"distances must increase, got \[2.0, 2.0\]"),
        ("[detection]\ndistances = [1, 2]\nreflectivities = [0, -1]", "numbers of at least 0"),
        (f"[detection]\ndistances = [{'9' * 400}]\nreflectivities = [1]", "number of usual size"),
        ("[noise]\nrange = -0.1", "noise: range must be a finite number of at least 0"),
        ("[noise]\ndropout = 1.1", "dropout must be a number from 0 to 1, got 1.1"),
        ("[noise]\nbias = inf", "bias must be a finite number"),
        ('[noise]\nangle = "1"', r"\[noise\]: angle must be a number, got '1'"),
    ],
)
def test_what_tables_may_not_say_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text + "\n" + PATTERN if "=" in text.split("\n")[0] else PATTERN + text)
    with pytest.raises(ValueError, match=said) as raised:
        load_sensor(path)
    assert str(path) in str(raised.value)


def test_what_is_stated_is_all_that_there_is(tmp_path: Path) -> None:
    """The file in the rules names every table and every name, with its default in brackets, and it can be loaded."""
    (text,) = re.findall(r"^```toml\n(.*?)^```$", RULES.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    (tmp_path / "stated.toml").write_text(text)
    assert load_sensor(tmp_path / "stated.toml").light is not None
    stated = tomllib.loads(text)
    assert {name: [*stated[name]] for name in TABLES} == {
        name: [field.name for field in fields(made)] for name, made in TABLES.items()
    }
    shown = dict(re.findall(r"^(\w+) = .*\((\S+?)(?:; [^)]*)?\)$", text, re.MULTILINE))
    for made in TABLES.values():
        for field in fields(made):
            if field.name in shown:
                default = getattr(made(), field.name)
                value = default[0] if field.name == "keep" else default
                assert tomllib.loads(f"it = {shown[field.name]}")["it"] == value, field.name
    assert len(shown) == 16


@pytest.mark.parametrize("name", sensor_names())
def test_sensors_that_are_brought_say_what_light_does(name: str) -> None:
    light = load_sensor(name).light
    assert light is not None and light.noise.range + light.noise.range_square > 0.0
    values = light_input(light)
    assert values is not None and set(values) == {"beam", "optics", "detection", "noise"}
    assert values["beam"]["keep"] == light.beam.keep

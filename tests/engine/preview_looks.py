"""Floors, lights, materials and cameras for tests of the preview mode: few, plain, and their light known on paper."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt
from perfect_bvh import (
    Appearance,
    Camera,
    ImageTexture,
    InstanceTable,
    LightPaths,
    LightTable,
    MaterialTable,
    MeshAppearance,
    RenderOptions,
    Scene,
    World,
    render,
)

SIZE = (32, 32)
BLACK, WHITE = World(), World((1.0, 1.0, 1.0))
PLAIN = 0.8  # the reflectance of a surface without a material
DIRECT = LightPaths(max_bounces=0)

QUAD = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
CORNER_UVS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)[QUAD]  # of a square: u along x, v along y
DOWN = np.eye(3, dtype=np.float32)  # shines along -z


def square(half: float, height: float) -> npt.NDArray[np.float64]:
    """A level square round the z axis; half of its side, in metres."""
    return np.array([(-half, -half, height), (half, -half, height), (half, half, height), (-half, half, height)])


FLOOR = square(50.0, 0.0)
ROOF = square(1.0, 1.0)
SMALL = square(0.025, 1.0)


def looking(eye: tuple[float, float, float], target: tuple[float, float, float], degrees: float) -> Camera:
    """A square camera, whose image has +Y on top where it looks straight down."""
    up = (0.0, 1.0, 0.0) if eye[:2] == target[:2] else (0.0, 0.0, 1.0)
    return Camera.look_at(eye, target, up=up, angle=math.radians(degrees), aspect=1.0)


ABOVE = looking((0, 0, 5), (0, 0, 0), 5.0)
ASIDE = looking((0, -30, 3), (0, 0, 0), math.degrees(0.05))
TILTED = looking((0, -4, 3), (0, -0.5, 0), 16.0)


def quads(*corners: npt.NDArray[np.float64], masks: tuple[int, ...] = ()) -> Scene:
    """A scene of an instance each; masks: which rays meet it, all if not given."""
    scene = Scene()
    for positions, mask in zip(corners, masks or (0xFFFFFFFF,) * len(corners), strict=True):
        scene.add_instance(scene.add_mesh(positions, QUAD), mask=mask)
    scene.commit()
    return scene


def floor(*more: npt.NDArray[np.float64]) -> Scene:
    return quads(FLOOR, *more)


def lights(
    kind: int,
    position: tuple[float, float, float] = (0, 0, 2),
    power: float = 100.0,
    size: tuple[float, float] = (0.0, 0.0),
    cone: tuple[float, float] = (math.pi, 0.0),
    count: int = 1,
) -> LightTable:
    """Some lights alike, over the floor's middle, that shine on it."""

    def rows(value: Any, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        return np.repeat(np.asarray(value, dtype)[None], count, axis=0)

    return LightTable(
        kinds=rows(kind, np.int32),
        positions=rows(position, np.float64),
        axes=rows(DOWN, np.float32),
        powers=rows((power,) * 3, np.float32),
        sizes=rows(size, np.float32),
        cones=rows(cone, np.float32),
        casts_shadow=rows(True, np.bool_),
    )


def materials(count: int = 1, **columns: npt.NDArray[Any]) -> MaterialTable:
    return MaterialTable(np.ones((count, 4), np.float32), np.zeros(count, np.int32), **columns)


def one_material(instances: int) -> InstanceTable:
    """Instances 0, 1 ... that all show material 0."""
    return InstanceTable(
        ids=np.arange(instances, dtype=np.int32),
        slot_offsets=np.arange(instances + 1, dtype=np.int32),
        slot_materials=np.zeros(instances, np.int32),
        object_indices=np.zeros(instances, np.int32),
        holdout=np.zeros(instances, np.bool_),
    )


def two_materials() -> InstanceTable:
    """Instances 0 and 1, each with the material of its number."""
    return replace(one_material(2), slot_materials=np.array([0, 1], np.int32))


def made_of(instances: int, **columns: Any) -> dict[str, Any]:
    """An Appearance's arguments for instances of one material: `Appearance(**made_of(1, metallics=1.0))`."""
    rows = {name: np.array([value], np.float32) for name, value in columns.items()}
    return {"instances": one_material(instances), "materials": materials(**rows)}


PLAIN_MATERIAL = {"metallics": 0.0, "roughnesses": 1.0, "reflectances": 0.0}


def emissive(radiance: float, **floors: float) -> Appearance:
    """A floor that gives back everything, and a black emissive square that no camera sees; nothing else emits."""
    table = materials(
        2,
        base_colors=np.array([(1, 1, 1), (0, 0, 0)], np.float32),
        emissions=np.array([(0, 0, 0), (radiance,) * 3], np.float32),
        **{name: np.array([value, PLAIN_MATERIAL[name]], np.float32) for name, value in floors.items()},
    )
    return Appearance(instances=two_materials(), materials=table, world=BLACK, camera_mask=0b01)


def sun_in_the_sky(rotation: float) -> tuple[Appearance, Appearance]:
    """A sun in a dim sky's image, and the same sun as a light under a sky as dim."""
    wide, high, radiance, sky = 256, 128, 5000.0, 0.05
    pixels = np.full((high, wide, 4), sky, np.float32)
    rows, columns = np.s_[90:93], np.s_[40:43]
    pixels[rows, columns, :3] = radiance
    azimuth = (0.5 - 41.5 / wide) * 2 * math.pi - rotation
    height = (91.5 / high - 0.5) * math.pi
    towards = np.array(
        (math.cos(height) * math.cos(azimuth), math.cos(height) * math.sin(azimuth), math.sin(height)), np.float32
    )
    side = np.array((-math.sin(azimuth), math.cos(azimuth), 0.0), np.float32)
    angle = 3 * 2 * math.pi / wide * math.cos(height) * 3 * math.pi / high
    sun = replace(
        lights(1, power=radiance * angle, size=(2 * math.sqrt(angle / math.pi), 0.0)),
        axes=np.stack([side, np.cross(towards, side), towards])[None].astype(np.float32),
    )
    around = Appearance(images=(ImageTexture(pixels),), world=replace(WHITE, image=0, rotation=rotation))
    return around, Appearance(lights=sun, world=World((sky,) * 3))


def papered(image: ImageTexture, **columns: Any) -> Appearance:
    """Mesh 0 shows an image once over its whole surface; `columns` set how its material uses the image."""
    return Appearance(
        meshes={0: MeshAppearance(corner_uvs=CORNER_UVS)},
        instances=one_material(1),
        materials=materials(**columns),
        images=(image,),
        world=WHITE,
    )


def brightness(
    scene: Scene, look: Appearance, camera: Camera = ABOVE, samples: int = 16, **options: Unpack[RenderOptions]
) -> float:
    """The mean of the image's middle."""
    image = render(scene, camera, "preview", SIZE, samples, look, **options)
    assert np.isfinite(image).all()
    return float(image[12:20, 12:20, 1].mean())


def noisy(scene: Scene, camera: Camera, look: Appearance, samples: int, seed: int = 0) -> npt.NDArray[np.float32]:
    """(32, 32) brightness with all its noise."""
    return render(scene, camera, "preview", SIZE, samples, look, seed=seed)[..., 1]


def quick_and_converged(scene: Scene, camera: Camera, look: Appearance) -> tuple[npt.NDArray[np.float32], ...]:
    """16 samples a pixel, and 512 others."""
    return noisy(scene, camera, look, 16, seed=1), noisy(scene, camera, look, 512, seed=2)

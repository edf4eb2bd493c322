"""A record's camera, materials and attributes as the engine's `Camera` and `Appearance`: all that colours an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from perfect_bvh import Camera, Lens
from perfect_bvh.appearance import (
    LIGHT_KINDS,
    Appearance,
    HairTable,
    ImageTexture,
    InstanceTable,
    LightTable,
    MaterialTable,
    MeshAppearance,
    World,
)
from perfect_bvh.finishes import FinishTable

from .records import (
    CATCHES_SHADOWS,
    VISIBLE_TO_CAMERA,
    VISIBLE_TO_DIFFUSE,
    VISIBLE_TO_GLOSSY,
    VISIBLE_TO_SHADOW,
    VISIBLE_TO_TRANSMISSION,
    CameraRecord,
    Float32Array,
    Int32Array,
    SceneRecord,
)


def as_camera(record: CameraRecord) -> Camera:
    """The engine's camera of a record."""
    return Camera(
        matrix=record.matrix,
        window=record.window,
        projection=record.projection,
        clip_start=record.clip_start,
        clip_end=record.clip_end,
        border=record.border,
        lens=None if record.lens is None else Lens(**asdict(record.lens)),
    )


def make_appearance(record: SceneRecord, instance_ids: Int32Array, mesh_ids: Int32Array) -> Appearance:
    """instance_ids: (I,) and mesh_ids: (M,), the engine's ids of the record's instances and meshes."""
    meshes = {
        int(mesh_id): MeshAppearance(
            material_slots=mesh.material_slots,
            corner_normals=mesh.corner_normals,
            corner_uvs=mesh.corner_uvs,
            corner_colors=mesh.corner_colors,
            named_uvs=mesh.named_uvs,
            named_colors=mesh.named_colors,
            tangents=mesh.tangents,
            texture_space=mesh.texture_space,
            corner_generated=mesh.corner_generated,
            curve_offsets=mesh.curve_offsets,
        )
        for mesh_id, mesh in zip(mesh_ids, record.meshes, strict=True)
    }
    return Appearance(
        meshes=meshes,
        instances=_instance_table(record, instance_ids),
        materials=_material_table(record),
        camera_mask=VISIBLE_TO_CAMERA,
        shadow_mask=VISIBLE_TO_SHADOW,
        diffuse_mask=VISIBLE_TO_DIFFUSE,
        glossy_mask=VISIBLE_TO_GLOSSY,
        transmission_mask=VISIBLE_TO_TRANSMISSION,
        catcher_mask=CATCHES_SHADOWS,
        film_transparent=record.film_transparent,
        plain_reflectance=record.plain_reflectance,
        pass_alpha_threshold=record.pass_alpha_threshold,
        images=tuple(
            [
                ImageTexture(image.pixels, image.extension, image.interpolation, image.tiles, image.is_linear)
                for image in record.images
            ]
        ),
        hair=_hair_table(record),
        finish=_finish_table(record),
        lights=_light_table(record),
        world=_world(record),
        backdrop=_backdrop(record),
    )


def _material_table(record: SceneRecord) -> MaterialTable:
    """A row a material.

    Without a world the materials were not asked what they are made of: then only the viewport colours are there.
    """
    materials = record.materials
    colors = np.array([material.color for material in materials], np.float32).reshape(-1, 4)
    indices = np.array([material.pass_index for material in materials], np.int32)
    if record.world is None:
        return MaterialTable(colors, indices)

    def numbers(name: str) -> Float32Array:
        return np.array([getattr(material, name) for material in materials], np.float32)

    def rows(name: str) -> Float32Array:
        return numbers(name).reshape(-1, 3)

    return MaterialTable(
        colors,
        indices,
        base_colors=rows("base_color"),
        emissions=rows("emission"),
        alphas=numbers("alpha"),
        metallics=numbers("metallic"),
        roughnesses=numbers("roughness"),
        lossy_facets=numbers("lossy_facets"),
        reflectances=numbers("reflectance"),
        transmissions=numbers("transmission"),
        translucencies=numbers("translucency"),
        iors=numbers("ior"),
        even_metals=numbers("even_metal"),
        tinted_glasses=numbers("tinted_glass"),
        plain_refractions=numbers("plain_refraction"),
        specular_tints=rows("specular_tint"),
        metal_colors=rows("metal_color"),
        metal_powers=numbers("metal_power"),
        transmission_colors=rows("transmission_color"),
        transmission_powers=numbers("transmission_power"),
        translucent_colors=rows("translucent_color"),
        translucent_powers=numbers("translucent_power"),
        holdouts=numbers("holdout"),
        programs=tuple([material.program for material in materials]),
        hairs=_rows_of([material.hair for material in materials]),
        finishes=_rows_of([material.finish for material in materials]),
    )


def _rows_of(found: Sequence[object | None]) -> Int32Array:
    """(M,) int32: of each material, the row of the table that has one for each that is not None; -1 for none."""
    is_there = np.array([one is not None for one in found], np.bool_)
    return np.where(is_there, np.cumsum(is_there) - 1, -1).astype(np.int32)


# Columns of `FinishTable` by the fields of `FinishRecord`.
_FINISH_COLUMNS = {
    **{
        name: f"{name}s"
        for name in ("sheen", "sheen_cover", "coat", "coat_ior", "coat_tint", "rotation", "distribution", "absorption")
    },
    **{name: f"{name}es" for name in ("sheen_roughness", "coat_roughness", "stretch", "diffuse_roughness")},
}


def _finish_table(record: SceneRecord) -> FinishTable:
    rows = [material.finish for material in record.materials if material.finish is not None]
    if not rows:
        return FinishTable()
    return FinishTable(
        **{
            column: np.array([getattr(row, name) for row in rows], np.float32)
            for name, column in _FINISH_COLUMNS.items()
        }
    )


def _hair_table(record: SceneRecord) -> HairTable:
    rows = [material.hair for material in record.materials if material.hair is not None]

    def numbers(name: str, *row: int) -> Float32Array:
        return np.array([getattr(hair, name) for hair in rows], np.float32).reshape(-1, *row)

    return HairTable(
        surfaces=numbers("surface"),
        fibers=numbers("fiber"),
        absorptions=numbers("absorption", 3),
        colored=np.array([hair.colored for hair in rows], np.bool_),
        roughnesses=numbers("roughness", 2),
        coats=numbers("coat"),
        tilts=numbers("tilt"),
        iors=numbers("ior"),
    )


def _world(record: SceneRecord) -> World | None:
    """None, which is the studio's sky, only where the record lacks the scene's own light."""
    world = record.world
    return None if world is None else World(world.color, world.image, world.rotation)


def _backdrop(record: SceneRecord) -> World | None:
    seen = record.world and record.world.backdrop
    return World(seen.color, seen.image, seen.rotation) if seen else None


def _light_table(record: SceneRecord) -> LightTable:
    lights = record.lights
    return LightTable(
        kinds=np.array([LIGHT_KINDS.index(kind) for kind in lights.kinds], np.int32),
        positions=lights.positions,
        axes=lights.axes,
        powers=lights.powers,
        sizes=lights.sizes,
        cones=lights.cones,
        casts_shadow=lights.casts_shadow,
    )


def _instance_table(record: SceneRecord, instance_ids: Int32Array) -> InstanceTable:
    """Each instance's materials, one after the other: those of its object.

    A triangle may refer to a slot that the object lacks; the renderer, as Blender, shows it in the last one.
    """
    instances = record.instances
    if not len(instances):
        return InstanceTable()
    objects = instances.object_indices
    flat = np.array([row for obj in record.objects for row in obj.material_slots], np.int64)
    counts = np.array([len(obj.material_slots) for obj in record.objects], np.int64)
    firsts = np.cumsum(counts) - counts

    instance_counts = counts[objects]
    offsets = np.concatenate([[0], np.cumsum(instance_counts)])
    places = np.arange(offsets[-1]) - np.repeat(offsets[:-1], instance_counts)
    places += np.repeat(firsts[objects], instance_counts)
    return InstanceTable(
        ids=instance_ids,
        slot_offsets=offsets.astype(np.int32),
        slot_materials=flat[places].astype(np.int32),
        object_indices=np.array([obj.pass_index for obj in record.objects], np.int32)[instances.object_indices],
        holdout=np.array([obj.holdout for obj in record.objects], np.bool_)[instances.object_indices],
        values=record.instance_values,
    )

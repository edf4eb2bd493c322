"""The result of a bake: arrays an object; as attributes of meshes, as images, as tables in files."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh._checks import check_count

from ..support.files import data_library, replacing
from ..sync.keys import UNUSED_LEVEL
from ..sync.records import Float32Array, Float64Array

REALISED = "Baked"  # the collection of copies that have values of their own
_CSV_ROWS = 65_536  # that are text at a time


@dataclass(frozen=True, slots=True, eq=False)
class BakedObject:
    """The values of one object, or of one instance of it, a row for each element of its mesh.

    Attributes:
        name, session_uid: The object's.
        instance: Blender's persistent id of an instance, (8,); empty for the object itself. instancer: The name of the
            object that makes it.
        columns: (N,) float64 by name, the main one first. NaN for an element without a value: a face without an area,
            a vertex without faces, a texel that the UV map does not cover, a solid that rays leave.
        error: (N,) float64, the standard error of the main column, for sampled kinds; else None.
        areas: (N,) float64, of faces in the world, if they are the elements; else None.
        origins: (N, 3) float64, where the rays of each face begin, in the world, if faces are the elements; else None.
        visible: (N, ceil(D / 8)) uint8, if asked for: bit d, the highest first, is 1 if direction d of the table is
            seen; `numpy.unpackbits` expands it.
        key: What the values depend on, as a text; "" if that is not known.
        positions, transform: (V, 3) float32 and (3, 4) float64, where the mesh was, in its own space and in the world.
    """

    name: str
    session_uid: int
    instance: tuple[int, ...]
    instancer: str
    columns: Mapping[str, Float64Array]
    error: Float64Array | None
    areas: Float64Array | None
    origins: Float64Array | None
    visible: npt.NDArray[np.uint8] | None
    key: str
    positions: Float32Array
    transform: Float64Array

    @property
    def values(self) -> Float64Array:
        """(N,) float64: the main column."""
        return next(iter(self.columns.values()))

    @property
    def all_columns(self) -> dict[str, Float64Array]:
        """The columns, with the error after them as NAME_error."""
        main = next(iter(self.columns))
        return dict(self.columns) | ({} if self.error is None else {f"{main}_error": self.error})


@dataclass(frozen=True, slots=True, eq=False)
class Bake:
    """The answers of `bake_rays`.

    Attributes:
        objects: In the order in which they were given; with instances each object first, then its instances.
        units: Of each column, "" for a share; "units" are Blender's. An error has its column's.
        ray_count: How many rays were cast; those below the horizon of their face are not.
        image_size: (width, height), of the domain "TEXEL": element y * width + x is a pixel, from the bottom left.
        warnings: Sentences: what the scene lacks, faces without an area.
        is_evaluated: Whether elements are those that modifiers make, which the objects' own meshes lack.
    """

    kind: str
    domain: str
    objects: tuple[BakedObject, ...]
    units: Mapping[str, str]
    ray_count: int
    image_size: tuple[int, int]
    warnings: tuple[str, ...] = ()
    is_evaluated: bool = False

    def __getitem__(self, name: str) -> BakedObject:
        """The values of an object by its name. Raises KeyError."""
        for baked in self.objects:
            if baked.name == name and not baked.instance:
                return baked
        raise KeyError(name)

    # Into Blender ----------------------------------------------------------------------------------------------------

    def write_attributes(self, name: str | None = None, *, realise: bool = False) -> tuple[str, ...]:
        """Writes the columns to float attributes of the objects' own meshes. Nothing is written if anything is refused.

        Elements without a value get 0.

        Args:
            name: Of the main column's attribute; None for the column's. The error's has `_error` after it.
            realise: Whether to write to copies of the meshes instead, where modifiers and the object place them, in new
                objects in the collection "Baked". Instances and objects that share a mesh need that. Copies are in
                the way of rays as all objects are: remove or hide them before the next bake.

        Returns:
            The names of the attributes.

        Raises:
            ValueError: For texels, and elements that modifiers make; for an object that is gone, is in Edit Mode or
                belongs to a library, for a mesh that has changed or is shared, and for an attribute or vertex group of
                that name that holds something else: by name. For a name that Blender does not take.
        """
        names = self.check_attributes(name, realise=realise)
        objects = _objects_by_uid()
        for baked in self.objects:
            obj = objects[baked.session_uid]
            mesh = _realise(obj, baked) if realise else obj.data
            for column, values in baked.all_columns.items():
                attribute = mesh.attributes.get(names[column])
                if attribute is not None and not self._fits(attribute):  # of a copy
                    mesh.attributes.remove(attribute)
                    attribute = None
                attribute = attribute or mesh.attributes.new(names[column], "FLOAT", self.domain)
                attribute.data.foreach_set("value", np.nan_to_num(values, nan=0.0).astype(np.float32))
            mesh.update()
        return tuple(names.values())

    def check_attributes(self, name: str | None = None, *, realise: bool = False) -> dict[str, str]:
        """Does all of `write_attributes` but writing; returns the names of the attributes by the columns'."""
        if self.domain == "TEXEL":
            raise ValueError("write_attributes: texels belong to images: call to_image, or bake another domain")
        if self.is_evaluated:
            raise ValueError("write_attributes: the elements are not those of the meshes: bake without evaluated=True")
        if not isinstance(name, str | None):
            raise ValueError(f"write_attributes: name must be a text, got {name!r}")
        names = {column: column for baked in self.objects for column in baked.all_columns}
        if name is not None:
            main = next(iter(self.units))
            names |= {column: column.replace(main, name, 1) for column in (main, f"{main}_error") if column in names}
        self._check_names(names.values())
        objects = _objects_by_uid()
        for baked in self.objects:
            obj = objects.get(baked.session_uid)
            if obj is None:
                raise ValueError(f"write_attributes: object {baked.name!r} was deleted since the bake")
            self._check_mesh(obj, baked, names.values(), realise)
        if not realise:
            self._check_sharing(objects)
        return names

    def _check_names(self, names: Iterable[str]) -> None:
        """Tries names of attributes on a mesh of its own: Blender has its own for some, and a largest length."""
        import bpy

        mesh = bpy.data.meshes.new("")
        try:
            for name in names:
                made = mesh.attributes.new(name, "FLOAT", self.domain)
                if made is None or made.name != name:
                    raise ValueError(f"write_attributes: an attribute cannot have the name {name!r}: choose another")
        finally:
            bpy.data.meshes.remove(mesh)

    def _check_mesh(self, obj: Any, baked: BakedObject, names: Iterable[str], realise: bool) -> None:
        """Checks that a mesh takes the values."""
        mesh = obj.data
        if mesh.is_editmode:
            raise ValueError(f"write_attributes: object {obj.name!r} is in Edit Mode: leave it first")
        elements = {"FACE": mesh.polygons, "CORNER": mesh.loops, "POINT": mesh.vertices}[self.domain]
        if len(elements) != len(baked.values):
            way_out = "bake it again, or apply the modifiers that make faces"
            raise ValueError(f"write_attributes: the mesh of object {obj.name!r} has other elements: {way_out}")
        if not realise and not mesh.is_editable:
            way_out = "make it local, or realise=True"
            raise ValueError(f"write_attributes: the mesh of {obj.name!r} is a library's: {way_out}")
        for name in names:
            if name in obj.vertex_groups:
                raise ValueError(f"write_attributes: {obj.name!r} has a vertex group {name!r}: choose a name")
            attribute = None if realise else mesh.attributes.get(name)
            if attribute is not None and not self._fits(attribute):
                what = f"{name!r}, a {attribute.data_type} of the domain {attribute.domain}"
                raise ValueError(f"write_attributes: {obj.name!r} has an attribute {what}: choose a name")

    def _check_sharing(self, objects: Mapping[int, Any]) -> None:
        """Checks that each mesh is that of one object in the scenes, without instances that have values."""
        users: dict[Any, list[Any]] = {}
        for obj in objects.values():
            if obj.users_scene:
                users.setdefault(obj.data, []).append(obj)
        for baked in self.objects:
            obj = objects[baked.session_uid]
            others = (f"{other.name!r}" for other in users.get(obj.data, ()) if other != obj)
            other = "an instance of it" if baked.instance else next(others, None)
            if other is not None:
                way_out = "make it single-user (Object > Relations), or write to copies with realise=True"
                raise ValueError(f"write_attributes: {obj.name!r} shares its mesh with {other}: {way_out}")

    def _fits(self, attribute: Any) -> bool:
        return (attribute.data_type, attribute.domain) == ("FLOAT", self.domain)

    def to_image(self, name: str | None = None, *, margin: int = 16) -> list[Any]:
        """Makes a float image of the main column of each object, grey, with alpha where the UV map is.

        Args:
            name: Of the images, after the object's; None for the column's. An image of that name is replaced.
            margin: How many pixels the values go beyond the edges of the map, 0 or more.

        Returns:
            `bpy.types.Image`s.

        Raises:
            ValueError: For a bake of another domain than texels.
        """
        import bpy

        if self.domain != "TEXEL":
            raise ValueError(f"to_image: the values are of the domain {self.domain}: bake with domain='TEXEL'")
        check_count("to_image", "margin", margin, 0)
        made = []
        for number, baked in enumerate(self.objects):
            width, height = self.image_size
            values = _spread(baked.values.reshape(height, width), margin)
            pixels = np.repeat(np.nan_to_num(values, nan=0.0)[:, :, None], 4, axis=2).astype(np.float32)
            pixels[:, :, 3] = ~np.isnan(values)
            title = f"{baked.name}{f' {number}' if baked.instance else ''} {name or next(iter(self.units))}"
            old = bpy.data.images.get(title)
            if old is not None and not (old.is_float and tuple(old.size) == self.image_size):
                bpy.data.images.remove(old)
                old = None
            how = {"alpha": True, "float_buffer": True, "is_data": True}
            image = old or bpy.data.images.new(title, width, height, **how)
            image.pixels.foreach_set(pixels.reshape(-1))
            image.update()
            made.append(image)
        return made

    # Into files ------------------------------------------------------------------------------------------------------

    def tables(self) -> Iterator[dict[str, npt.NDArray[Any]]]:
        """Yields a table for each object, column by column: object, instance, element, its area, its values.

        Texels outside the UV map have no row.
        """
        for baked in self.objects:
            levels = [str(level) for level in baked.instance if level != UNUSED_LEVEL]
            count, instance = len(baked.values), " ".join([baked.instancer, *levels]).strip()
            table: dict[str, Any] = {"object": np.full(count, baked.name), "instance": np.full(count, instance)}
            table |= {self.domain.lower(): np.arange(count)} | ({} if baked.areas is None else {"area": baked.areas})
            table |= baked.all_columns
            rows = np.flatnonzero(~np.isnan(baked.values)) if self.domain == "TEXEL" else slice(None)
            yield {name: column[rows] for name, column in table.items()}

    def write_csv(self, path: str | os.PathLike[str]) -> Path:
        """Writes the tables, one after the other. Raises OSError."""
        path = Path(path)
        with replacing(path) as name, name.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            for number, table in enumerate(self.tables()):
                if number == 0:
                    writer.writerow(table)
                for first in range(0, len(table["object"]), _CSV_ROWS):
                    rows = slice(first, first + _CSV_ROWS)
                    writer.writerows(zip(*(column[rows].tolist() for column in table.values()), strict=True))
        return path

    def write_parquet(self, path: str | os.PathLike[str]) -> Path:
        """Writes the same as Parquet. Raises ImportError with what to install, and OSError."""
        path, needs = Path(path), "Parquet files need pyarrow"
        pyarrow, parquet = data_library("pyarrow", needs), data_library("pyarrow.parquet", needs)
        whole = pyarrow.concat_tables([pyarrow.table(table) for table in self.tables()])
        with replacing(path) as name:
            parquet.write_table(whole, name)
        return path


def _objects_by_uid() -> dict[int, Any]:
    import bpy

    return {obj.session_uid: obj for obj in bpy.data.objects}


def _realise(obj: Any, baked: BakedObject) -> Any:
    """Makes an object with a copy of the mesh, as it is in the evaluated scene; returns the mesh."""
    import bpy
    import mathutils

    collection = bpy.data.collections.get(REALISED)
    if collection is None:
        collection = bpy.data.collections.new(REALISED)
        bpy.context.scene.collection.children.link(collection)
    mesh = obj.data.copy()
    made = bpy.data.objects.new(f"{obj.name} {REALISED.lower()}", mesh)
    made.shape_key_clear()
    linear, positions = baked.transform[:, :3], baked.positions
    squares = linear.T @ linear
    if np.abs(squares - np.diag(np.diag(squares))).max() > 1e-6 * squares.max():  # objects have no shear
        mirror = math.copysign(1.0, np.linalg.det(linear))
        positions, linear = (positions @ (mirror * linear).T).astype(np.float32), mirror * np.eye(3)
    mesh.vertices.foreach_set("co", positions.reshape(-1))
    matrix = np.vstack([np.c_[linear, baked.transform[:, 3]], (0.0, 0.0, 0.0, 1.0)])
    made.matrix_world = mathutils.Matrix(matrix.tolist())
    collection.objects.link(made)
    return mesh


def _spread(values: Float64Array, margin: int) -> Float64Array:
    """Fills pixels without a value with the mean of their neighbours' values, `margin` pixels far."""
    height, width = values.shape
    for _ in range(margin):
        padded = np.pad(values, 1, constant_values=np.nan)
        around = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
        counts = sum(~np.isnan(part) for part in around)
        means = sum(np.nan_to_num(part, nan=0.0) for part in around) / np.maximum(counts, 1)
        values = np.where(np.isnan(values) & (counts > 0), means, values)
    return values

"""Denoising with every available library: it reduces noise, leaves clean pixels alone, and survives any input."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import perfect_bvh
import pytest
from forks import needs_fork, run_in_child
from perfect_bvh import _oidn
from perfect_bvh.denoise import JOINT_NAME, Denoiser, denoise, denoiser_name

WIDTH, HEIGHT = 96, 64
ONE_SAMPLE, MANY_SAMPLES = 4, 64


class Picture:
    """Two surfaces with a checkerboard, under light that falls off, and a noisy image of them as of few samples."""

    def __init__(self, rng: np.random.Generator) -> None:
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        self.albedo = np.where(((x // 8 + y // 8) % 2)[..., None] == 0, (0.8, 0.7, 0.5), (0.2, 0.3, 0.5)).astype("f4")
        self.normal = np.where((x < 50)[..., None], (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)).astype("f4")
        light = (0.2 + np.hypot(x - 20, y - 40) / 60)[..., None] * np.where((x < 50)[..., None], 1.0, 0.4)
        self.clean = (self.albedo * light).astype("f4")
        self._rng = rng

    def noisy(self, samples: int) -> np.ndarray:
        """Means of exponentially distributed samples, as light that is seldom met makes them."""
        shares = self._rng.gamma(samples, 1.0 / samples, (HEIGHT, WIDTH, 1))
        return (self.clean * shares).astype("f4")

    def error(self, image: np.ndarray) -> float:
        return float(np.sqrt(np.mean((image[..., :3] - self.clean) ** 2)))


@pytest.fixture
def picture(rng: np.random.Generator) -> Picture:
    return Picture(rng)


def test_noise_falls_and_texture_stays(picture: Picture) -> None:
    noisy = picture.noisy(ONE_SAMPLE)
    smooth = denoise(noisy, picture.albedo, picture.normal, backend="joint")
    assert smooth.dtype == np.float32 and smooth.shape == noisy.shape
    assert picture.error(smooth) < 0.25 * picture.error(noisy)


def test_guides_keep_edges_that_colors_alone_lose(picture: Picture) -> None:
    noisy = picture.noisy(ONE_SAMPLE)
    guided = denoise(noisy, picture.albedo, picture.normal, backend="joint")
    half = denoise(noisy, picture.albedo, backend="joint")
    alone = denoise(noisy, backend="joint")
    assert picture.error(guided) < picture.error(half) < picture.error(alone) < picture.error(noisy)


def test_an_image_without_noise_stays(picture: Picture) -> None:
    smooth = denoise(picture.clean, picture.albedo, picture.normal, backend="joint")
    assert picture.error(smooth) < 0.15 * picture.error(picture.noisy(MANY_SAMPLES))


@pytest.mark.parametrize("threads", [2, 3, 7])
def test_threads_change_no_bit(picture: Picture, threads: int) -> None:
    noisy = picture.noisy(ONE_SAMPLE)
    expected = denoise(noisy, picture.albedo, picture.normal, backend="joint", threads=1)
    result = denoise(noisy, picture.albedo, picture.normal, backend="joint", threads=threads)
    np.testing.assert_array_equal(result, expected)


def test_alpha_and_arguments_are_untouched(picture: Picture, rng: np.random.Generator) -> None:
    alpha = rng.random((HEIGHT, WIDTH, 1), np.float32)
    noisy = np.concatenate([picture.noisy(ONE_SAMPLE), alpha], axis=-1)
    given = noisy.copy()
    smooth = denoise(noisy, picture.albedo, backend="joint")
    np.testing.assert_array_equal(smooth[..., 3:], alpha)
    np.testing.assert_array_equal(smooth[..., :3], denoise(noisy[..., :3], picture.albedo, backend="joint"))
    np.testing.assert_array_equal(noisy, given)


def test_nothing_is_put_where_nothing_was(picture: Picture) -> None:
    noisy = np.concatenate([picture.noisy(ONE_SAMPLE), np.ones((HEIGHT, WIDTH, 1), np.float32)], axis=-1)
    noisy[:, 60:] = 0.0
    smooth = denoise(noisy, backend="joint")
    assert not smooth[:, 60:].any() and smooth[:, :60].all()


def test_a_denoiser_carries_nothing_from_image_to_image(picture: Picture) -> None:
    first, second = picture.noisy(ONE_SAMPLE), picture.noisy(ONE_SAMPLE)
    kept = Denoiser((WIDTH, HEIGHT), backend="joint")
    kept.denoise(first, picture.albedo, picture.normal)
    np.testing.assert_array_equal(kept.denoise(second), denoise(second, backend="joint"))
    assert kept.name == JOINT_NAME


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_counts_as_black(picture: Picture, wrong: float) -> None:
    spoilt, black = picture.noisy(ONE_SAMPLE), None
    spoilt[10, 20] = wrong
    black = np.where(np.isfinite(spoilt), spoilt, 0.0)
    albedo = picture.albedo.copy()
    albedo[30, 40, 1] = wrong
    result = denoise(spoilt, albedo, picture.normal, backend="joint")
    assert np.isfinite(result).all()
    np.testing.assert_array_equal(
        result, denoise(black, np.nan_to_num(albedo, posinf=0, neginf=0), picture.normal, backend="joint")
    )


def test_huge_numbers_give_finite_ones() -> None:
    color = np.full((5, 7, 3), 1e30, np.float32)
    color[2, 3] = 0.0
    assert np.isfinite(denoise(color, backend="joint")).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1)])
def test_smallest_images(size: tuple[int, int]) -> None:
    color = np.full((size[1], size[0], 3), 0.25, np.float32)
    result = denoise(color, np.zeros_like(color), np.zeros_like(color), backend="joint")
    np.testing.assert_allclose(result, color, rtol=1e-5)


def test_any_layout_and_dtype(picture: Picture) -> None:
    noisy = picture.noisy(ONE_SAMPLE)
    expected = denoise(noisy, picture.albedo, backend="joint")
    np.testing.assert_array_equal(denoise(noisy.astype("f8"), picture.albedo[::-1][::-1], backend="joint"), expected)
    np.testing.assert_array_equal(denoise(np.asfortranarray(noisy), picture.albedo, backend="joint"), expected)


def test_progress_stops_it(picture: Picture) -> None:
    large = np.tile(picture.noisy(ONE_SAMPLE), (20, 20, 1))
    with pytest.raises(perfect_bvh.Cancelled):
        denoise(large, backend="joint", progress=lambda done: False)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"color": np.zeros((4, 5))}, r"denoise: color must have shape \(H, W, 3\) or \(H, W, 4\), got \(4, 5\)"),
        ({"color": np.zeros((4, 5, 2))}, r"denoise: color must have shape \(4, 5, 3\) or \(4, 5, 4\), got \(4, 5, 2\)"),
        ({"albedo": np.zeros((5, 4, 3))}, r"denoise: albedo must have shape \(4, 5, 3\), got \(5, 4, 3\)"),
        ({"normal": np.zeros((4, 5, 4))}, r"denoise: normal must have shape \(4, 5, 3\), got \(4, 5, 4\)"),
        ({"color": np.zeros((0, 5, 3))}, "Denoiser: "),
        ({"prefilter": "twice"}, "Denoiser: prefilter must be one of .*'twice'"),
        ({"quality": "best"}, "Denoiser: quality must be one of .*'best'"),
        ({"backend": "optix"}, "Denoiser: backend must be one of .*'optix'"),
        ({"threads": -1}, "Denoiser: threads must be an integer from 0 to .*-1"),
        ({"libraries": 7}, "Denoiser: libraries must be paths of files, got 7"),
    ],
)
def test_bad_arguments(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        denoise(**{"color": np.zeros((4, 5, 3)), **arguments})


# A library -----------------------------------------------------------------------------------------------------------

SOURCE = """
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
typedef int (*Monitor)(void*, double);
static int threads, error;
static Monitor monitor;
static float *color, *out;
static size_t count;
static int fails(const char* at) { return strcmp(FAILS_AT, at) == 0 ? (error = CODE, 1) : 0; }
void* oidnNewDevice(int type) { return fails("new") ? 0 : &threads; }
void oidnSetDeviceInt(void* d, const char* name, int value) { threads = value; }
void oidnSetDeviceBool(void* d, const char* name, _Bool value) {}
int oidnGetDeviceInt(void* d, const char* name) { return strcmp(name, "versionMajor") == 0 ? MAJOR : 7; }
void oidnCommitDevice(void* d) { fails("device"); }
int oidnGetDeviceError(void* d, const char** message) {
  int code = error;
  error = 0;
  *message = code ? "on purpose" : 0;
  return code;
}
void oidnReleaseDevice(void* d) {}
void* oidnNewFilter(void* d, const char* type) { return &count; }
void oidnSetSharedFilterImage(void* f, const char* name, void* image, int format, size_t width, size_t height,
                              size_t offset, size_t pixel, size_t row) {
  if (strcmp(name, "color") == 0) color = image, count = width * height * 3;
  if (strcmp(name, "output") == 0) out = image;
}
void oidnSetFilterBool(void* f, const char* name, _Bool value) {}
void oidnSetFilterInt(void* f, const char* name, int value) {}
void oidnSetFilterProgressMonitorFunction(void* f, Monitor function, void* user) { monitor = function; }
void oidnCommitFilter(void* f) { fails("filter"); }
void oidnExecuteFilter(void* f) {
  if (fails("run")) return;
  while (strcmp(FAILS_AT, "never ends") == 0)
    if (!monitor(0, 0.5)) { error = 6; return; }
  for (size_t i = 0; i < count; ++i) out[i] = color[i] + threads;
}
void oidnReleaseFilter(void* f) {}
"""


SIDE = 16  # of the smallest image that a library gets


class Libraries:
    """Makes libraries of OpenImageDenoise's interface that add the number of threads to colours, or fail."""

    def __init__(self, compiler: str, folder: Path) -> None:
        self._compiler, self._folder, self._count = compiler, folder, 0

    def make(self, fails_at: str = "", code: int = 1, major: int = 2) -> Path:
        self._count += 1
        source, library = self._folder / "fake.c", self._folder / f"fake_{self._count}.so"
        source.write_text(SOURCE)
        defines = [f'-DFAILS_AT="{fails_at}"', f"-DCODE={code}", f"-DMAJOR={major}"]
        command = [self._compiler, "-x", "c", "-shared", "-fPIC", *defines, str(source), "-o", str(library)]
        subprocess.run(command, check=True, capture_output=True)
        return library


@pytest.fixture
def libraries(tmp_path: Path) -> Libraries:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no C compiler")
    return Libraries(compiler, tmp_path)


@pytest.mark.parametrize("threads", [1, 3])
def test_a_library_by_its_path_is_used_with_its_threads(libraries: Libraries, threads: int) -> None:
    path = libraries.make()
    color = np.full((SIDE, SIDE, 3), 0.5, np.float32)
    made = Denoiser((SIDE, SIDE), libraries=[path], threads=threads)
    assert made.name == denoiser_name([path]) == "OpenImageDenoise 2.7.7" and not made.complaints
    np.testing.assert_array_equal(made.denoise(color, color, color), color + threads)


def test_threads_are_the_engine_s_if_not_told(libraries: Libraries) -> None:
    color = np.zeros((SIDE, SIDE, 3), np.float32)
    result = denoise(color, libraries=[libraries.make()])
    np.testing.assert_array_equal(result, color + perfect_bvh.thread_count())


@pytest.mark.parametrize(("fails_at", "major"), [("new", 2), ("device", 2), ("", 3)])
def test_a_library_that_cannot_be_used_is_told_of(libraries: Libraries, fails_at: str, major: int) -> None:
    broken, whole = libraries.make(fails_at, major=major), libraries.make()
    made = Denoiser((SIDE, SIDE), libraries=[broken, whole])
    assert made.name == "OpenImageDenoise 2.7.7"
    assert len(made.complaints) == 1 and str(broken) in made.complaints[0]


def test_files_that_are_none_or_no_library_are_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_oidn, "_package_paths", list)
    text = tmp_path / "text.so"
    text.write_text("no library")
    paths = [tmp_path / "missing.so", text, ""]
    made = Denoiser((SIDE, SIDE), libraries=paths)
    assert len(made.complaints) == 3
    assert "missing.so" in made.complaints[0] and "text.so" in made.complaints[1]
    assert made.denoise(np.zeros((SIDE, SIDE, 3))).shape == (SIDE, SIDE, 3)


def test_without_a_library_the_joint_filter_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_oidn, "LIBRARY_NAME", "libOpenImageDenoise_that_no_system_has.so.2")
    monkeypatch.setattr(_oidn, "_package_paths", list)
    monkeypatch.setattr(_oidn, "_found", {})
    made = Denoiser((SIDE, SIDE))
    assert made.name == denoiser_name() == JOINT_NAME and made.complaints == ()
    with pytest.raises(perfect_bvh.EngineError, match="there is no OpenImageDenoise: use backend='auto'"):
        Denoiser((SIDE, SIDE), backend="oidn")


@pytest.mark.parametrize(("code", "error"), [(1, perfect_bvh.EngineError), (4, MemoryError)])
@pytest.mark.parametrize("fails_at", ["filter", "run"])
def test_failures_of_the_library_are_raised(libraries: Libraries, fails_at: str, code: int, error: type) -> None:
    made = Denoiser((SIDE, SIDE), libraries=[libraries.make(fails_at, code)])
    with pytest.raises(error, match=r"denoise: OpenImageDenoise .*on purpose"):
        made.denoise(np.zeros((SIDE, SIDE, 3)))


def test_a_library_is_stopped(libraries: Libraries) -> None:
    made = Denoiser((SIDE, SIDE), libraries=[libraries.make("never ends")])
    shares = []
    with pytest.raises(perfect_bvh.Cancelled):
        made.denoise(np.zeros((SIDE, SIDE, 3)), progress=lambda done: shares.append(done) or len(shares) < 3)
    assert len(shares) == 3 and max(shares) == 0.5


def test_an_error_of_progress_stops_a_library_and_is_raised(libraries: Libraries) -> None:
    made = Denoiser((SIDE, SIDE), libraries=[libraries.make("never ends")])

    def fail(done: float) -> bool:
        raise KeyError("progress")

    with pytest.raises(KeyError, match="progress"):
        made.denoise(np.zeros((SIDE, SIDE, 3)), progress=fail)


@needs_fork
def test_a_forked_child_does_without_a_library(libraries: Libraries) -> None:
    path = libraries.make()
    color = np.zeros((SIDE, SIDE, 3), np.float32)
    before = Denoiser((SIDE, SIDE), libraries=[path])

    def work() -> bool:
        with pytest.raises(perfect_bvh.EngineError, match="forked process"):
            before.denoise(color)
        made = Denoiser((SIDE, SIDE), libraries=[path])
        return made.name == JOINT_NAME and "forked" in made.complaints[0] and not made.denoise(color).any()

    assert run_in_child(work) == 0
    np.testing.assert_array_equal(before.denoise(color), color + perfect_bvh.thread_count())

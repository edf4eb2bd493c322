"""Give each ray its own time: a wheel that turns while the shutter is open, and when a ray hits a blade."""

import numpy as np
import perfect_bvh
from shared import read_arguments, save_png

folder, width = read_arguments(480)
scene = perfect_bvh.Scene()
blade = scene.add_mesh([(0, -0.1, 0), (2, -0.1, 0), (2, 0.1, 0), (0, 0.1, 0)], [(0, 1, 2), (0, 2, 3)])
wheel = scene.add_instances(np.full(5, blade), np.broadcast_to(np.eye(4), (5, 4, 4)))


def turned(angles: np.ndarray) -> np.ndarray:
    """Return (N, 4, 4) rotations about the Z axis."""
    matrices = np.broadcast_to(np.eye(4), (len(angles), 4, 4)).copy()
    matrices[:, 0, 0] = matrices[:, 1, 1] = np.cos(angles)
    matrices[:, 1, 0] = np.sin(angles)
    matrices[:, 0, 1] = -np.sin(angles)
    return matrices


angles = 2 * np.pi * np.arange(5) / 5
scene.set_instance_motion(wheel, [turned(angles), turned(angles + np.pi / 10)])  # at time 0 and at time 1
scene.commit()

x, y = np.meshgrid(np.linspace(-2.2, 2.2, width), np.linspace(2.2, -2.2, width))
origins = np.stack([x, y, np.full_like(x, 5)], axis=-1)
random, image = np.random.default_rng(1), np.zeros((width, width))
for _ in range(16):
    image += scene.cast_rays(origins, [0.0, 0.0, -1.0], times=random.random(x.shape)).is_hit / 16
save_png(folder / "rays_in_time.png", np.repeat(image[..., None], 3, axis=2))

times = np.linspace(0, 1, 10_001)
hits = scene.cast_rays((1.5, 0.3, 5), np.broadcast_to([0, 0, -1.0], (10_001, 3)), times=times)
print(f"a blade is over (1.5, 0.3) between {times[hits.is_hit].min():.3f} and {times[hits.is_hit].max():.3f}")

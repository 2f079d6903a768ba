"""Pictures of `beamspot render`, on one thread, for the benches that weigh noise against time."""

import resource
import subprocess
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np


def rendered(binary, scene, *options):
    """Planes of a scene's picture by name, "Y" and "Y.variance" and so on, and CPU seconds.

    A variant of mitsuba, which reads the EXR, has to be set.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.exr")
        command = [binary, "render", scene, "-o", path, "--threads", "1", *map(str, options)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run(command, check=True, capture_output=True)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        bitmap = mi.Bitmap(str(path))
    names = [bitmap.struct_()[k].name for k in range(bitmap.channel_count())]
    return dict(zip(names, np.moveaxis(np.array(bitmap, dtype=float), 2, 0))), seconds

"""Hands exported materials to the programs that they are for, and compares the light that comes back with ours.

    pip install . pmcxcl && apt-get install pocl-opencl-icd      # MCX, and OpenCL for processors
    pip install . bpy                                            # Blender, whose versions are each for one of Python
    python tests/python/export_programs.py BEAMSPOT FOLDER [mcx] [blender]

Each program gets the file that `beamspot table convert` leaves in FOLDER, and an even beam (MCX) or an even sky
(Cycles) over a half-space; what leaves is set beside the transport equation's. No part of CI: bpy has 350 MB.
Mitsuba and MaterialX are in test_exports.py.

pmcxcl 0.7.5 brings a C++ library of its own in which that of Debian's pocl gets lost ('stdint.h' file not found): call it
with LD_PRELOAD=libstdc++.so.6.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

import beamspot


# Of MCX: its runs differ by twice of what the number of photons says, so that several tell the error.
PHOTONS = 200_000
SEEDS = range(1, 6)


def exported(command, folder, target, name, *options):
    path = folder / name
    call = [command, "table", "convert", folder / "materials.csv", "--to", target, "-o", path, "--force", *options]
    subprocess.run(call, check=True, capture_output=True)
    return path


def mcx(command, folder):
    """Photons of MCX through voxels, with the units and media of the file. A photon that leaves a side is lost to the
    total, so that the media are those in which light does not come so far."""
    import pmcxcl

    for unit_mm in (1.0, 0.5):
        options = ["--scene-unit-mm", str(unit_mm), "--material", "Skin1"]
        domain = json.loads(exported(command, folder, "mcx", "skin1.json", *options).read_text())["Domain"]
        assert domain["LengthUnit"] == unit_mm
        media = [[m["mua"], m["mus"], m["g"], m["n"]] for m in domain["Media"]]
        side, depth = int(70 / unit_mm), int(35 / unit_mm)
        rows = beamspot.materials("skin1")
        for medium, row in zip(media[1:], rows):
            settings = {
                "nphoton": PHOTONS,
                "vol": np.ones((side, side, depth), dtype=np.uint8),
                "prop": [media[0], medium],
                "unitinmm": domain["LengthUnit"],
                "srctype": "pencil",
                "srcpos": [side / 2, side / 2, 0],
                "srcdir": [0, 0, 1],
                "tstart": 0, "tend": 2e-8, "tstep": 2e-8,
                "isreflect": 1, "isspecular": 1,
            }
            stats = [pmcxcl.run({**settings, "seed": seed})["stat"] for seed in SEEDS]
            # Of the light that has entered.
            back = np.array([1 - stat["energyabs"] / stat["energytot"] for stat in stats])
            u = back.std(ddof=1) / np.sqrt(len(back))
            yield f"mcx, unit {unit_mm} mm, {row.material} {row.channel}", back.mean(), u, entered(row)


def entered(row):
    """Share of the light that has entered a half-space along its normal that comes back."""
    medium = {"sigma_s_prime": row.sigma_s_prime_per_mm, "sigma_a": row.sigma_a_per_mm, "eta": row.eta}
    return beamspot.total_reflectance(**medium, model="monte-carlo", g=0.0)


def total(row):
    """Share of the light along the normal that comes back, what the surface reflects included."""
    surface = ((row.eta - 1) / (row.eta + 1)) ** 2
    return surface + (1 - surface) * entered(row)


def blender(command, folder):
    """Cycles under an even sky, seen along the normal: by reciprocity the same total."""
    import bpy

    for name in ("Apple", "Chicken1", "Potato", "Skin1", "Marble"):
        script = exported(command, folder, "blender", f"{name}.py", "--scene-unit-mm", "10", "--material", name)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        exec(compile(script.read_text(), str(script), "exec"), {})
        scene = bpy.context.scene
        scene.render.engine = "CYCLES"
        scene.cycles.device, scene.cycles.samples = "CPU", 256
        scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
        scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 64
        scene.render.resolution_x = scene.render.resolution_y = 16
        scene.world = bpy.data.worlds.new("sky")
        scene.world.use_nodes = True
        scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
        bpy.ops.mesh.primitive_cube_add(size=1000, location=(0, 0, -500))
        bpy.context.object.data.materials.append(bpy.data.materials[name])
        bpy.ops.object.camera_add(location=(0, 0, 50))
        scene.camera = bpy.context.object
        scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1.0
        scene.view_settings.view_transform = "Raw"
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        scene.render.filepath = str(folder / f"{name}.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
        found, u = pixels.mean(axis=0), pixels.std(axis=0) / np.sqrt(len(pixels))
        for k, row in enumerate(beamspot.materials(name)):
            yield f"cycles, {row.material} {row.channel}", found[k], u[k], total(row)


PROGRAMS = {"mcx": mcx, "blender": blender}


def main(command, folder, *programs):
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    table = Path(__file__).resolve().parents[2] / "data/materials.csv"
    (folder / "materials.csv").write_text(table.read_text())
    for program in programs or PROGRAMS:
        for what, found, u, ours in PROGRAMS[program](command, folder):
            print(f"{what}: {found:.4f} +- {u:.4f}, beamspot {ours:.4f}: {100 * (found / ours - 1):+.2f} %", flush=True)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

"""What `table convert` writes, opened by the programs that it is for."""

import ast
import csv
import json
import os
import subprocess
from pathlib import Path

import beamspot
import jsonschema
import MaterialX
import mitsuba
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
TABLE = ROOT / "data/materials.csv"


@pytest.fixture(scope="module")
def convert(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports")

    def run(to, name, *options):
        path = folder / name
        call = [os.environ["BEAMSPOT_BIN"], "table", "convert", TABLE, "--to", to, "-o", path, "--force", *options]
        subprocess.run(call, check=True, capture_output=True)
        return path

    return run


def test_json_follows_the_published_schema(convert):
    schema = json.loads((ROOT / "schemas/materials.schema.json").read_text())
    document = json.loads(convert("json", "materials.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(document, schema)
    assert len(document["materials"]) == 36
    document["materials"][0]["sigma_a"] = 1
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document, schema)


def test_the_datapackage_describes_its_table(convert):
    path = convert("datapackage", "datapackage.json")
    resource = json.loads(path.read_text())["resources"][0]
    header, *rows = list(csv.reader((path.parent / resource["path"]).open()))
    fields = resource["schema"]["fields"]
    assert [field["name"] for field in fields] == header
    for row in rows:
        for field, cell in zip(fields, row):
            assert cell or not field["constraints"]["required"]
            if cell and field["type"] == "number":
                float(cell)


def test_materialx_validates_the_surfaces(convert):
    document = MaterialX.createDocument()
    MaterialX.readFromXmlFile(document, str(convert("openpbr", "materials.mtlx", "--scene-unit-mm", "10")))
    library = MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), library)
    document.setDataLibrary(library)
    valid, message = document.validate()
    assert valid, message
    surface = document.getNode("Marble_surface")
    definition = surface.getNodeDef()
    assert definition is not None and definition.getNodeString() == "open_pbr_surface"
    radius = surface.getInput("subsurface_radius").getValue() * np.array(
        list(surface.getInput("subsurface_radius_scale").getValue().asTuple())
    )
    np.testing.assert_allclose(radius, [0.0456, 0.0381, 0.0333], atol=5e-5)


def normal_albedo(albedo):
    """Share of light along the normal that a half-space without a surface gives back, scattering isotropically: by
    Chandrasekhar's H function (Radiative Transfer, 1960, sections 33 and 38)."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    mu, weights = (1 + nodes) / 2, weights / 2
    root = np.sqrt(1 - albedo)
    h = np.ones_like(mu)

    def at(x):
        return 1 / (root + albedo / 2 * np.sum(weights * mu * h / (np.atleast_1d(x)[:, None] + mu), axis=1))

    for _ in range(2000):
        h = at(mu)
    return 1 - root * at(1.0)[0]


def test_blender_gets_the_total_and_the_diffusion_length(convert):
    tree = ast.parse(convert("blender", "materials.py").read_text())
    table = next(ast.literal_eval(node.value) for node in tree.body if isinstance(node, ast.Assign))
    marble = table["Marble"]
    color, mean_free_path = np.array(marble["color"]), np.array(marble["radius"]) / (4 * np.pi) * 1000
    # What is absorbed, out of the colour: van de Hulst's fit, a square in its root.
    half = 1.139 + 1.17 * color
    root = (half - np.sqrt(half**2 - 4 * 0.139 * (1 - color))) / (2 * 0.139)
    np.testing.assert_allclose(mean_free_path / (np.sqrt(3) * root), [8.51, 5.57, 3.95], atol=5e-3)
    # Green marble gives back 0.8076 of light along the normal by adding-doubling, what its surface mirrors among it.
    mirrored = (0.5 / 2.5) ** 2
    found = mirrored + (1 - mirrored) * normal_albedo(1 - root[1] ** 2)
    np.testing.assert_allclose(found, 0.8076, atol=5e-4)


def test_mitsuba_reflects_what_we_do(convert):
    """A half-space under an even sky, seen along its normal: by reciprocity its total reflectance, the surface's
    own included, against the transport equation's. `BEAMSPOT_EFFORT` multiplies the samples."""
    effort = int(os.environ.get("BEAMSPOT_EFFORT", "1"))
    mitsuba.set_variant("scalar_rgb")
    path = convert("mitsuba", "apple.xml", "--material", "Apple")
    scene = mitsuba.load_string(
        f"""<scene version="3.0.0">
            <include filename="{path}"/>
            <integrator type="volpathmis">
                <integer name="max_depth" value="-1"/><integer name="rr_depth" value="1000000"/>
            </integrator>
            <emitter type="constant"><float name="radiance" value="1"/></emitter>
            <sensor type="orthographic">
                <transform name="to_world"><lookat origin="0, 0, 10" target="0, 0, 0" up="0, 1, 0"/></transform>
                <film type="hdrfilm">
                    <integer name="width" value="20"/><integer name="height" value="20"/>
                    <rfilter type="box"/>
                </film>
            </sensor>
            <shape type="cube">
                <transform name="to_world"><scale value="1000"/><translate z="-1000"/></transform>
                <ref id="Apple"/><ref name="interior" id="Apple_medium"/>
            </shape>
        </scene>"""
    )
    pixels = np.array(mitsuba.render(scene, spp=20 * effort), dtype=float)[..., :3].reshape(-1, 3)
    found, u_found = pixels.mean(axis=0), pixels.std(axis=0) / np.sqrt(len(pixels))
    for k, row in enumerate(beamspot.materials("apple")):
        medium = {"sigma_s_prime": row.sigma_s_prime_per_mm, "sigma_a": row.sigma_a_per_mm, "eta": row.eta}
        surface = ((row.eta - 1) / (row.eta + 1)) ** 2
        total = surface + (1 - surface) * beamspot.total_reflectance(**medium, model="monte-carlo", g=0.0)
        print(f"{row.channel}: mitsuba {found[k]:.5f} +- {u_found[k]:.5f}, beamspot {total:.5f}")
        assert abs(found[k] - total) < 3.5 * u_found[k]
        assert u_found[k] < 0.03 / np.sqrt(effort) * total

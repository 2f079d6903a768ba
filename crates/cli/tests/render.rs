//! `render`: what it promises, and its answers to bad input.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

mod call;

use call::call;
use std::fs;

const SCENE: &str = r#"
channels = ["Y"]
[camera]
kind = "orthographic"
from_mm = [0, -30, 20]
to_mm = [0, 0, 0]
height_mm = 14
width_px = 16
height_px = 12
[[object]]
name = "sample"
shape = "block"
min_mm = [-4, -4, -4]
max_mm = [4, 4, 4]
medium = { sigma_a_per_mm = 0.05, sigma_s_per_mm = 1 }
eta = 1.4
[[light]]
kind = "beam"
from_mm = [0, -1, 20]
direction = [0, 0, -1]
radius_mm = 0.5
"#;

#[test]
fn one_run_or_several_on_any_number_of_threads_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("scene.toml"), SCENE).unwrap();
    let run = |name: &str, more: &[&str]| {
        let mut arguments = vec!["render", "scene.toml", "-o", name, "--photons", "200"];
        arguments.extend(more);
        let (code, out, error) = call(path, &arguments);
        assert_eq!(code, Some(0), "{more:?}: {error}");
        out
    };
    let out = run("a.exr", &["--rounds", "12", "--threads", "1"]);
    assert!(out.contains("sample") && out.contains("12 rounds"), "{out}");
    run("b.exr", &["--rounds", "5", "--threads", "3"]);
    run("b.exr", &["--rounds", "12", "--threads", "2", "--resume"]);
    for ending in ["exr", "png", "json", "state"] {
        let bytes = |name: &str| fs::read(path.join(format!("{name}.{ending}"))).unwrap();
        assert!(bytes("a") == bytes("b"), "{ending}");
    }
    for cloud in ["hierarchy", "smoothstep"] {
        let bytes = |name: &str, threads: &str| {
            let more = ["--method", "point-cloud", "--cloud", cloud];
            run(
                name,
                &[&more[..], &["--rounds", "3", "--threads", threads]].concat(),
            );
            fs::read(path.join(name)).unwrap()
        };
        let (one, three) = (format!("{cloud}1.exr"), format!("{cloud}3.exr"));
        assert!(bytes(&one, "1") == bytes(&three, "3"), "{cloud}");
    }
    // A state of another scene, or a damaged one, is not gone on with.
    let other = SCENE.replace("= 1.4", "= 1.5");
    fs::write(path.join("scene.toml"), other).unwrap();
    let goes_on = ["render", "scene.toml", "-o", "b.exr", "--resume"];
    let (code, _, error) = call(path, &goes_on);
    assert!(
        code == Some(3) && error.contains("another scene"),
        "{error}"
    );
    let state = fs::read(path.join("b.state")).unwrap();
    fs::write(path.join("b.state"), &state[..100]).unwrap();
    let (code, _, error) = call(path, &goes_on);
    assert_eq!(code, Some(3), "{error}");
}

#[test]
fn every_method_makes_a_picture_with_its_components() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let layered = SCENE.replace("eta = 1.4", "eta = 1.33\nlayers = \"leaf\"");
    fs::write(path.join("scene.toml"), layered).unwrap();
    for (name, more) in [
        ("m", &["--method", "monte-carlo", "--photons", "300"][..]),
        ("j", &["--method", "bssrdf"]),
        ("c", &["--method", "bssrdf", "--bssrdf", "corrected"]),
        ("t", &["--method", "bssrdf", "--bssrdf", "monte-carlo"]),
        ("h", &["--method", "point-cloud"]),
        ("s", &["--method", "point-cloud", "--cloud", "smoothstep"]),
        ("b", &["--method", "brdf"]),
        ("l", &["--method", "brdf", "--brdf", "lambert"]),
        ("y", &["--method", "brdf", "--brdf", "layered"]),
    ] {
        let output = format!("{name}.exr");
        let common = [
            "render",
            "scene.toml",
            "-o",
            &output,
            "--rounds",
            "4",
            "--json",
        ];
        let arguments = [&common[..], more, &["--components"]].concat();
        let (code, out, error) = call(path, &arguments);
        assert_eq!(code, Some(0), "{more:?}: {error}");
        let document: serde_json::Value = serde_json::from_str(&out).unwrap();
        assert_eq!(document["rounds"], 4);
        let exr = fs::read(path.join(&output)).unwrap();
        let header = String::from_utf8_lossy(&exr[..2000]);
        assert!(header.contains("single.Y.variance"), "{header}");
    }
}

#[test]
fn methods_are_held_against_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("scene.toml"), SCENE).unwrap();
    let validate = [
        "validate",
        "scene.toml",
        "-o",
        "v",
        "--rounds",
        "20",
        "--photons",
        "500",
    ];
    let (code, out, error) = call(path, &validate);
    assert_eq!(code, Some(0), "{error}");
    assert!(
        out.contains("bssrdf-corrected: noise") && out.contains("wrote v/"),
        "{out}"
    );
    let page = fs::read_to_string(path.join("v/validation.html")).unwrap();
    for name in [
        "monte-carlo.png",
        "brdf-lambert.png",
        "bssrdf-directional-difference.png",
        "bssrdf-directional-flip.png",
    ] {
        assert!(
            page.contains(name) && path.join("v").join(name).exists(),
            "{name}"
        );
    }
    assert!(page.contains("power out through") && page.contains("sample, +z"));
    // A picture is itself; another seed is another by its noise alone.
    let (code, out, error) = call(
        path,
        &[
            "compare",
            "v/brdf-jensen.exr",
            "v/brdf-jensen.exr",
            "--json",
        ],
    );
    assert_eq!(code, Some(0), "{error}");
    let same: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(same["channels"][0]["rmse"], 0.0);
    assert_eq!(same["flip"], 0.0);
    let again = [
        "render",
        "scene.toml",
        "-o",
        "m.exr",
        "--seed",
        "2",
        "--rounds",
        "20",
        "--photons",
        "500",
    ];
    assert_eq!(call(path, &again).0, Some(0));
    let compare = [
        "compare",
        "m.exr",
        "v/monte-carlo.exr",
        "-o",
        "d.png",
        "--json",
    ];
    let (code, out, error) = call(path, &compare);
    assert_eq!(code, Some(0), "{error}");
    let other: serde_json::Value = serde_json::from_str(&out).unwrap();
    let chi2 = other["channels"][0]["chi2_per_pixel"].as_f64().unwrap();
    // Of 192 pixels, with errors from 20 rounds.
    assert!((0.6..1.6).contains(&chi2), "{out}");
    for file in ["d.png", "d.svg", "d-flip.png"] {
        assert!(path.join(file).exists(), "{file}");
    }
    for ring in other["rings"].as_array().unwrap() {
        assert!(ring["z"].as_f64().unwrap_or(0.0).abs() < 5.0, "{ring}");
    }
    // Powers through faces stand beside what `render` made, and differ by their noise alone.
    let third = again.map(|word| match word {
        "m.exr" => "n.exr",
        "2" => "3",
        word => word,
    });
    assert_eq!(call(path, &third).0, Some(0));
    let (code, out, error) = call(path, &["compare", "m.exr", "n.exr", "--json"]);
    assert_eq!(code, Some(0), "{error}");
    let other: serde_json::Value = serde_json::from_str(&out).unwrap();
    let faces = other["faces"].as_array().unwrap();
    assert_eq!(faces.len(), 6, "{out}");
    for face in faces {
        assert!(face["z"].as_f64().unwrap().abs() < 5.0, "{face}");
    }
    fs::write(path.join("small.toml"), SCENE.replace("= 16", "= 8")).unwrap();
    assert_eq!(
        call(
            path,
            &["render", "small.toml", "-o", "s.exr", "--rounds", "2"]
        )
        .0,
        Some(0)
    );
    let (code, _, error) = call(path, &["compare", "s.exr", "m.exr"]);
    assert!(code == Some(3) && error.contains("8 x 12"), "{error}");
}

/// What is wrong is named, with exit code 3, and nothing is left behind.
#[test]
fn bad_scenes_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(
        path.join("open.obj"),
        "v 0 0 0\nv 5 0 0\nv 0 5 0\nv 0 0 5\nf 1 3 2\nf 1 2 4\nf 1 4 3\n",
    )
    .unwrap();
    fs::write(
        path.join("flat.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    )
    .unwrap();
    fs::write(
        path.join("nan.obj"),
        "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    )
    .unwrap();
    fs::write(path.join("empty.obj"), "# nothing\n").unwrap();
    fs::write(path.join("index.obj"), "v 0 0 0\nf 1 2 9\n").unwrap();
    let header = "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\n\
                  property float y\nproperty float z\nend_header\n0 0 0\n";
    fs::write(path.join("cut.ply"), header).unwrap();
    fs::write(
        path.join("normal.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvn nan 0 1\nf 1//1 2//2 3//1\n",
    )
    .unwrap();
    let block = "shape = \"block\"\nmin_mm = [-4, -4, -4]\nmax_mm = [4, 4, 4]\n";
    let mesh = |file: &str| SCENE.replace(block, &format!("shape = \"mesh\"\nfile = \"{file}\"\n"));
    let with_ball = |center: &str, radius: f64| {
        format!(
            "{SCENE}[[object]]\nname = \"ball\"\nshape = \"sphere\"\ncenter_mm = {center}\n\
             radius_mm = {radius}\nmedium = {{ sigma_a_per_mm = 0.05, sigma_s_per_mm = 1 }}\n\
             eta = 1.4\n"
        )
    };
    for (scene, said) in [
        (
            SCENE.replace("eta = 1.4", "etta = 1.4"),
            "did you mean `eta`",
        ),
        (SCENE.replace("eta = 1.4", ""), "`eta` is missing"),
        (SCENE.replace("eta = 1.4", "eta = 9"), "between 0.2 and 5"),
        (
            SCENE.replace("sigma_a_per_mm = 0.05", "sigma_a_per_mm = -1"),
            "at least 0 mm^-1",
        ),
        (
            SCENE.replace("from_mm = [0, -30, 20]", "from_mm = [0, -1, 1]"),
            "camera stands inside sample",
        ),
        (
            SCENE.replace("from_mm = [0, -1, 20]", "from_mm = [0, -1, 0]"),
            "light 1 is inside sample",
        ),
        (
            SCENE.replace("max_mm = [4, 4, 4]", "max_mm = [4, -5, 4]"),
            "`min_mm` below",
        ),
        (SCENE.replace("width_px = 16", "width_px = 0"), "at least 1"),
        (
            SCENE
                .replace("medium = {", "#")
                .replace("eta = 1.4", "material = \"granite\""),
            "no material is called `granite`",
        ),
        (
            SCENE[..SCENE.find("[[light]]").unwrap()].to_owned(),
            "has no light",
        ),
        (
            SCENE.replace("eta = 1.4", "eta = 1.4\nlayers = \"leaf\""),
            "give `eta = 1.33`",
        ),
        (
            SCENE.replace("eta = 1.4", "eta = 1.4\nlayers = \"none.toml\""),
            "none.toml",
        ),
        (
            SCENE.replace("eta = 1.4", "eta = 1.33\nlayers = [\"leaf\", \"leaf\"]"),
            "expected one name, or 1",
        ),
        (mesh("none.obj"), "none.obj"),
        (mesh("flat.obj"), "encloses no volume"),
        (mesh("nan.obj"), "nan.obj: OBJ: line 1: `v 0 0 nan`"),
        (mesh("empty.obj"), "no triangle"),
        (mesh("index.obj"), "out of bounds; the file is damaged"),
        (mesh("cut.ply"), "got 1); the file is cut short"),
        (mesh("open.obj"), "no path finds it"),
        (mesh("normal.obj"), "line 5: `vn nan 0 1`"),
        (
            with_ball("[0, 0, 5]", 1.01),
            "objects sample and ball share space around",
        ),
        (
            with_ball("[0, 0, 0]", 1.01),
            "object ball is inside sample, where no light would find it",
        ),
        (with_ball("[0, 0, 0]", 9.0), "object sample is inside ball"),
        (
            SCENE.replace(
                "kind = \"beam\"\nfrom_mm = [0, -1, 20]\ndirection = [0, 0, -1]\nradius_mm = 0.5",
                "kind = \"area\"\ncorner_mm = [-9, -9, 3]\nu_mm = [9, 0, 0]\nv_mm = [0, 9, 0]",
            ),
            "light 1 is inside sample",
        ),
    ] {
        fs::write(path.join("scene.toml"), &scene).unwrap();
        let (code, _, error) = call(
            path,
            &["render", "scene.toml", "-o", "x.exr", "--rounds", "1"],
        );
        assert_eq!(code, Some(3), "{said}: {error}");
        assert!(
            error.contains(said) && error.contains("scene.toml"),
            "{said}: {error}"
        );
        assert!(!path.join("x.exr").exists());
    }
    // A clear block: transport shows it, and models of the surface refuse it.
    let clear = SCENE.replace("= 0.05, sigma_s_per_mm = 1", "= 0, sigma_s_per_mm = 0");
    fs::write(path.join("scene.toml"), clear).unwrap();
    for (method, code) in [
        ("monte-carlo", 0),
        ("brdf", 3),
        ("bssrdf", 3),
        ("point-cloud", 3),
    ] {
        let method = ["--method", method, "--rounds", "2", "--photons", "10"];
        let output = format!("{}.exr", method[1]);
        let (found, _, error) = call(
            path,
            &[&["render", "scene.toml", "-o", &output][..], &method].concat(),
        );
        assert_eq!(found, Some(code), "{method:?}: {error}");
        assert!(code == 0 || error.contains("clear medium"), "{error}");
    }
    // A camera that looks away: a picture of nothing, and what to look for.
    let away = SCENE.replace("to_mm = [0, 0, 0]", "to_mm = [0, -60, 40]");
    fs::write(path.join("scene.toml"), away).unwrap();
    let dark = ["render", "scene.toml", "-o", "dark.exr", "--rounds", "2"];
    let (code, _, error) = call(path, &[&dark[..], &["--photons", "10"]].concat());
    assert!(
        code == Some(0) && error.contains("picture is black"),
        "{error}"
    );
    // Open, but under a sky: a picture, and a warning.
    let open = mesh("open.obj").replace(
        "kind = \"beam\"\nfrom_mm = [0, -1, 20]\ndirection = [0, 0, -1]\nradius_mm = 0.5",
        "kind = \"sky\"",
    );
    fs::write(path.join("scene.toml"), open).unwrap();
    let (code, _, error) = call(
        path,
        &["render", "scene.toml", "-o", "x.exr", "--rounds", "1"],
    );
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains("not closed"), "{error}");
    for (more, said) in [
        (
            &["--bssrdf", "dipol", "--method", "bssrdf"][..],
            "there are jensen2001",
        ),
        (&["--until-error", "0", "--rounds", "1"], "above 0"),
        (&["--rounds", "0", "--seed", "1"], "at least one"),
        (&["--exposure", "0", "--seed", "1"], "above 0"),
        (
            &["--method", "point-cloud", "--scatter-radius=-1"],
            "--scatter-radius",
        ),
    ] {
        let arguments = [&["render", "scene.toml", "-o", "y.exr"][..], more].concat();
        let (code, _, error) = call(path, &arguments);
        assert_eq!(code, Some(2), "{said}: {error}");
        assert!(error.contains(said), "{said}: {error}");
    }
}

#[test]
fn profiles_and_tables_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let head = "channel,radius_mm,reflectance_per_mm2,u_reflectance_per_mm2\n";
    let profile = |factor: f64| {
        let rows = [1.0_f64, 2.0, 4.0]
            .map(|r| format!("G,{r},{},{}\n", factor / (r * r), 0.01 * factor / (r * r)));
        format!("{head}{}", rows.concat())
    };
    fs::write(path.join("a.csv"), profile(1.02)).unwrap();
    // Between its radii the first is a line in the logarithms: a power law is met.
    let b = profile(1.0).replace("G,2,0.25,0.0025\n", "G,3,0.1111111111111111,0.001\n");
    fs::write(path.join("b.csv"), b).unwrap();
    let (code, out, error) = call(path, &["compare", "a.csv", "b.csv", "--json"]);
    assert_eq!(code, Some(0), "{error}");
    let found: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(found["kind"], "profiles");
    let pairs = found["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 3);
    for pair in pairs {
        assert!(
            (pair["relative"].as_f64().unwrap() - 0.02).abs() < 1e-9,
            "{pair}"
        );
    }
    // 2 % over the root of the two squares.
    let z = 0.02 / 0.01 / 1.02_f64.hypot(1.0);
    assert!((pairs[0]["z"].as_f64().unwrap() - z).abs() < 1e-9, "{out}");

    let row = |value: &str| {
        format!(
            "material,channel,sigma_s_prime_per_mm,u_sigma_s_prime_per_mm,sigma_a_per_mm,u_sigma_a_per_mm,eta\n\
             stone,G,2,0.1,{value},0.01,1.5\n"
        )
    };
    fs::write(path.join("s.csv"), row("0.5")).unwrap();
    fs::write(path.join("t.csv"), row("0.4")).unwrap();
    let (code, out, error) = call(path, &["compare", "s.csv", "t.csv"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(
        out.contains("stone G") && out.contains("+25.00 %") && out.contains("+7.1"),
        "{out}"
    );
    for (files, shown) in [
        (["a.csv", "b.csv", "p.svg"], "Two profiles"),
        (["s.csv", "t.csv", "q.svg"], "Two tables"),
    ] {
        let [a, b, plot] = files;
        let (code, out, error) = call(path, &["compare", a, b, "-o", plot]);
        assert!(code == Some(0) && out.contains(plot), "{error}");
        let plot = fs::read_to_string(path.join(plot)).unwrap();
        assert!(plot.contains(shown) && !plot.contains("NaN"), "{plot}");
        let (code, _, error) = call(path, &["compare", a, b, "-o", "d.png"]);
        assert!(code == Some(2) && error.contains(".svg"), "{error}");
    }
    for (files, said) in [
        (["a.csv", "s.csv"], "one of each"),
        (["a.csv", "none.csv"], "none.csv"),
    ] {
        let (code, _, error) = call(path, &["compare", files[0], files[1]]);
        assert!(code == Some(3) && error.contains(said), "{error}");
    }
}

/// The loop closed: a spot that the renderer made, through the frames of a camera, gives the
/// coefficients back that were rendered.
#[test]
fn a_rendered_spot_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let medium = "material = \"wax\"\neta = 1.4\n[[channel]]\nname = \"Y\"\n\
                  sigma_a_per_mm = 0.06\nsigma_s_prime_per_mm = 1.1\n";
    fs::write(path.join("wax.toml"), medium).unwrap();
    let camera = "width = 160\nheight = 160\nmm_per_pixel = 0.15\nchannels = \"mono\"\nbeam_fwhm_mm = 0.6\n\
                  [reference]\nu_reflectance = 0.0\n";
    fs::write(path.join("camera.toml"), camera).unwrap();
    let synth = |medium: &str, camera: &str, to: &str| {
        let arguments = [
            "synth",
            "--medium",
            medium,
            "--camera",
            camera,
            "--model",
            "render",
            "--photons",
            "3e5",
            "-o",
            to,
        ];
        call(path, &arguments)
    };
    let (code, _, error) = synth("wax.toml", "camera.toml", "capture");
    assert_eq!(code, Some(0), "{error}");
    let measure = [
        "measure",
        "capture/capture.toml",
        "-o",
        "result",
        "--model",
        "monte-carlo",
        "--g",
        "0",
        "--no-confirm",
    ];
    let (code, out, error) = call(path, &measure);
    assert_eq!(code, Some(0), "{out}{error}");
    let fit = fs::read_to_string(path.join("result/fit.json")).unwrap();
    let fit: serde_json::Value = serde_json::from_str(&fit).unwrap();
    for (key, truth) in [("sigma_a_per_mm", 0.06), ("sigma_s_prime_per_mm", 1.1)] {
        let number = |name: &str| fit["channels"][0][key][name].as_f64().unwrap();
        let (found, u) = (number("value"), number("u"));
        println!("{key}: {found} +- {u} of {truth}");
        assert!((found - truth).abs() < 4.0 * u, "{key}: {found} of {truth}");
        assert!(u < 0.02 * truth, "{key}: {u}");
    }
    // The noise of the photons is in all frames alike; without knowing of it, chi2 is 588.
    let chi2 = fit["channels"][0]["reduced_chi2"].as_f64().unwrap();
    assert!(chi2 < 2.0, "{chi2}");
    assert_eq!(fit["channels"][0]["verdict"]["good"], true);
    // Another rendering is not that of the frames.
    let manifest = path.join("capture/capture.toml");
    let text = fs::read_to_string(&manifest).unwrap();
    let small = SCENE.replace("height_px = 12", "height_px = 8");
    fs::write(path.join("small.toml"), small).unwrap();
    let render = ["render", "small.toml", "-o", "small.exr", "--rounds", "2"];
    assert_eq!(call(path, &render).0, Some(0));
    for (rendering, said) in [
        ("../small.exr", "16 x 8 pixels and 1 channels"),
        ("none.exr", "none.exr"),
        ("capture.toml", "capture.toml"),
    ] {
        let text = text.replace("sample/rendering.exr", rendering);
        assert!(text.contains(rendering));
        fs::write(&manifest, text).unwrap();
        let (code, _, error) = call(path, &["measure", "capture/capture.toml", "-o", "other"]);
        assert!(code == Some(3) && error.contains(said), "{error}");
    }
    let tilted = format!("{camera}camera_angle_deg = 20\n");
    fs::write(path.join("tilted.toml"), tilted).unwrap();
    fs::write(path.join("clear.toml"), medium.replace("0.06", "0")).unwrap();
    for (medium, camera, said) in [
        ("wax.toml", "tilted.toml", "camera_angle_deg"),
        ("clear.toml", "camera.toml", "without absorption"),
    ] {
        let (code, _, error) = synth(medium, camera, "other");
        assert!(code == Some(3) && error.contains(said), "{error}");
        assert!(!path.join("other").exists());
    }
}

/// A picture of floating-point numbers, as FITS has them.
fn fits(width: usize, values: &[f32]) -> Vec<u8> {
    let height = values.len() / width;
    let cards = [
        "SIMPLE  =                    T".to_owned(),
        "BITPIX  =                  -32".to_owned(),
        "NAXIS   =                    2".to_owned(),
        format!("NAXIS1  = {width:>20}"),
        format!("NAXIS2  = {height:>20}"),
        "END".to_owned(),
    ];
    let mut bytes: Vec<u8> = cards
        .iter()
        .flat_map(|card| format!("{card:<80}").into_bytes())
        .collect();
    bytes.resize(2880, b' ');
    bytes.extend(values.iter().flat_map(|v| v.to_be_bytes()));
    bytes.resize(2 * 2880, 0);
    bytes
}

/// A texture is shown by every model of the surface, and what cannot be one is named.
#[test]
fn textures_are_shown_or_answered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let write = |name: &str, bytes: &[u8]| fs::write(path.join(name), bytes).unwrap();
    write("grays.pgm", b"P5 2 2 255\n\x80\xa0\xa0\xd0");
    write("small.pgm", b"P5 1 1 255\n\x10");
    write("rgb.ppm", b"P6 1 1 255\n\x10\x10\x10");
    write("cut.pgm", b"P5 2 2 255\n\x10");
    write("no.png", b"nothing");
    write("half.fits", &fits(2, &[0.5; 4]));
    write("bright.fits", &fits(2, &[0.5, 0.5, 0.5, 1.25]));
    write("negative.fits", &fits(2, &[0.5, -0.25, 0.5, 0.5]));
    write("nan.fits", &fits(2, &[0.5, f32::NAN, 0.5, 0.5]));
    write("black.pgm", b"P5 2 2 255\n\x00\x00\x00\x00");
    let sky = SCENE.replace(
        "kind = \"beam\"\nfrom_mm = [0, -1, 20]\ndirection = [0, 0, -1]\nradius_mm = 0.5",
        "kind = \"sky\"",
    );
    let texture = |keys: &str| {
        let keys = format!("eta = 1.4\ntexture = {{ {keys} }}");
        fs::write(path.join("scene.toml"), sky.replace("eta = 1.4", &keys)).unwrap();
    };
    let render = |more: &[&str]| {
        let common = ["render", "scene.toml", "-o", "x.exr", "--force"];
        call(path, &[&common[..], more].concat())
    };
    // The light of a texture of one value is that of the medium with this value. Where bssrdf
    // has no texture it draws in another way: there the two agree within their noise only.
    let mean = |name: &str| {
        let (code, out, error) = call(path, &["compare", name, name, "--json"]);
        assert_eq!(code, Some(0), "{error}");
        let found: serde_json::Value = serde_json::from_str(&out).unwrap();
        found["channels"][0]["mean"][0].as_f64().unwrap()
    };
    for (more, within) in [
        (&["--method", "bssrdf", "--rounds", "400"][..], 2e-3),
        (&["--method", "point-cloud", "--rounds", "2"], 1e-4),
        (&["--method", "brdf", "--rounds", "2"], 1e-4),
    ] {
        if !more.contains(&"point-cloud") {
            texture("size_mm = [3, 3], albedo = \"grays.pgm\"");
            let (code, _, error) = render(more);
            assert_eq!(code, Some(0), "{more:?}: {error}");
        }
        let even = sky.replace("= 0.05, sigma_s_per_mm = 1", "= 0.5, sigma_s_per_mm = 1");
        fs::write(path.join("scene.toml"), even).unwrap();
        assert_eq!(render(more).0, Some(0));
        let expected = mean("x.exr");
        texture("size_mm = [3, 3], sigma_a_per_mm = { file = \"half.fits\", scale = 1 }");
        assert_eq!(render(more).0, Some(0));
        let found = mean("x.exr");
        println!("{more:?}: {found} for {expected}");
        assert!((found / expected - 1.0).abs() < within, "{more:?}");
    }
    let layers = SCENE.replace(
        "eta = 1.4",
        "eta = 1.33\nlayers = \"leaf\"\ntexture = { size_mm = [3, 3], albedo = \"grays.pgm\" }",
    );
    fs::write(path.join("scene.toml"), layers).unwrap();
    let (code, _, error) = render(&["--method", "brdf", "--brdf", "layered"]);
    assert!(
        code == Some(3) && error.contains("has a `texture`"),
        "{error}"
    );
    texture("size_mm = [3, 3], albedo = \"grays.pgm\"");
    let (code, _, error) = render(&["--method", "monte-carlo"]);
    assert!(
        code == Some(3) && error.contains("nothing of the medium inside"),
        "{error}"
    );
    for (keys, said) in [
        ("size_mm = [3, 3]", "expected either `albedo`"),
        ("albedo = \"grays.pgm\"", "`size_mm` is missing"),
        (
            "size_mm = [3, 0], albedo = \"grays.pgm\"",
            "`size_mm`: expected a number above 0",
        ),
        (
            "size_mm = [3, 3], albedo = \"none.png\"",
            "`albedo`: none.png",
        ),
        ("size_mm = [3, 3], albedo = \"no.png\"", "no.png: no frame"),
        ("size_mm = [3, 3], albedo = \"cut.pgm\"", "cut.pgm"),
        (
            "size_mm = [3, 3], albedo = \"rgb.ppm\"",
            "rgb.ppm: expected a gray picture",
        ),
        (
            "size_mm = [3, 3], albedo = \"bright.fits\"",
            "bright.fits: pixel 1, 1: expected a share from 0 to 1, found 1.25",
        ),
        (
            "size_mm = [3, 3], sigma_s_prime_per_mm = \"negative.fits\"",
            "`sigma_s_prime_per_mm`: negative.fits: pixel 1, 0: expected a coefficient",
        ),
        (
            "size_mm = [3, 3], sigma_a_per_mm = \"nan.fits\"",
            "nan.fits: pixel 1, 0",
        ),
        (
            "size_mm = [3, 3], sigma_a_per_mm = { file = \"grays.pgm\", scale = -1 }",
            "`scale`: expected a number above 0",
        ),
        (
            "size_mm = [3, 3], sigma_a_per_mm = { file = \"grays.pgm\", scale = [1, 2] }",
            "expected one number, or 1",
        ),
        (
            "size_mm = [3, 3], sigma_a_per_mm = \"grays.pgm\", sigma_s_per_mm = \"small.pgm\"",
            "small.pgm: expected 2 x 2 pixels",
        ),
        (
            "size_mm = [3, 3], albedo = \"grays.pgm\", sigma_a_per_mm = \"grays.pgm\"",
            "expected either `albedo`",
        ),
        (
            "size_mm = [3, 3], sigma_a_per_mm = \"black.pgm\", sigma_s_per_mm = \"black.pgm\"",
            "pixel 0, 0 of its texture",
        ),
        (
            "size_mm = [3, 3], albedo = 0.5",
            "expected the name of a picture",
        ),
        (
            "size_mm = [3, 3], albdo = \"grays.pgm\"",
            "did you mean `albedo`",
        ),
    ] {
        texture(keys);
        let (code, _, error) = call(
            path,
            &["render", "scene.toml", "-o", "y.exr", "--method", "brdf"],
        );
        assert_eq!(code, Some(3), "{said}: {error}");
        assert!(
            error.contains(said) && error.contains("scene.toml"),
            "{said}: {error}"
        );
        assert!(!path.join("y.exr").exists());
    }
    let ball = SCENE.replace(
        "shape = \"block\"\nmin_mm = [-4, -4, -4]\nmax_mm = [4, 4, 4]\n",
        "shape = \"mesh\"\nfile = \"tetra.obj\"\ntexture = { albedo = \"grays.pgm\" }\n",
    );
    write(
        "tetra.obj",
        b"v 0 0 0\nv 5 0 0\nv 0 5 0\nv 0 0 5\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    );
    fs::write(path.join("scene.toml"), ball).unwrap();
    let (code, _, error) = render(&["--method", "brdf"]);
    assert!(
        code == Some(3) && error.contains("no texture coordinates"),
        "{error}"
    );
}

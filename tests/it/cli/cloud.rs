//! Clouds of points from import to export.

use super::Place;
use super::points::apart;
use std::path::Path;
use tetreel::image::read_exr;

fn data(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/npz").join(name).to_str().unwrap().to_owned()
}

/// A file of VTK's vertices, one cell each or all in one.
fn vertices(types: &str, offsets: &str) -> String {
    let array = |name: &str, kind: &str, width: usize, text: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{width}\" format=\"ascii\">{text}</DataArray>"
        )
    };
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"><UnstructuredGrid><Piece NumberOfPoints=\"6\" NumberOfCells=\"{}\">\
         <PointData>{}{}</PointData><Points>{}</Points><Cells>{}{}{}</Cells></Piece></UnstructuredGrid></VTKFile>",
        types.split(' ').count(),
        array("s", "Float32", 1, "0 1 2 3 4 5"),
        array("radius", "Float64", 1, "0.1 0.2 0.3 0.2 0.1 -1"),
        array("Points", "Float64", 3, "0 0 0 1 0 0 0 1 0 0 0 1 1 1 0 1 0 1"),
        array("connectivity", "Int64", 1, "0 1 2 3 4 5"),
        array("offsets", "Int64", 1, offsets),
        array("types", "UInt8", 1, types),
    )
}

#[test]
fn clouds_are_imported_shown_and_exported() {
    let place = Place::empty();
    let (one_each, all_in_one) = (vertices("1 1 1 1 1 1", "1 2 3 4 5 6"), vertices("2", "6"));
    std::fs::write(place.path("each.vtu"), one_each).unwrap();
    std::fs::write(place.path("all.vtu"), all_in_one).unwrap();
    for source in ["each.vtu", "all.vtu"] {
        let said = place.ok(&["import", source, "-o", "v.zarr", "--overwrite"]);
        assert!(said.contains("5 points, radius 0.1 to 0.3") && said.contains("above zero dropped: 1"), "{said}");
        assert!(place.ok(&["info", "v.zarr"]).starts_with("cloud    5 points, radius 0.1 to 0.3"));
    }
    let info = place.json(&["info", "v.zarr", "--json"]);
    assert_eq!((&info["mesh"]["kind"], &info["version"]["store"]), (&"points".into(), &"2.0".into()));
    place.ok(&["export", "v.zarr", "-o", "back.pvd"]);
    let planned = place.ok(&["import", "back.pvd", "--dry-run"]);
    // To 24 bits, as the field of radii has them.
    assert!(planned.contains("5 points, radius 0.1"), "{planned}");

    place.ok(&["import", &data("cloud.npz"), "-o", "c.zarr"]);
    let info = place.json(&["info", "c.zarr", "--json"]);
    assert_eq!((&info["mesh"]["vertices"], &info["time"]["steps"]), (&8.into(), &2.into()));
    let size = ["--size", "48x48", "--tf", "viridis@0:0.1,1:0.3"];
    let render = |image: &str, rest: &[&str]| {
        place.ok(&[&["render", "c.zarr", "-o", image, "--steps", "1"], &size[..], rest].concat());
        std::fs::read(place.path(image)).unwrap()
    };
    let usual = render("auto.png", &[]);
    assert!(render("points.png", &["--mode", "points"]) == usual);
    assert!(render("circle.png", &["--mode", "points", "--footprint", "circle"]) == usual);
    assert!(render("square.png", &["--mode", "points", "--footprint", "square"]) != usual);
    assert!(render("small.png", &["--mode", "points", "--point-radius", "0.5"]) != usual);
    let half = ["--mode", "points", "--lod", "0.8"];
    assert!(render("half.png", &half) != usual);
    assert!(render("random.png", &[&half[..], &["--sampling", "random"]].concat()) == render("half.png", &half));
    render("global.png", &[&half[..], &["--sampling", "global"]].concat());
    let wide = place.ok(&["import", &data("cloud.npz"), "-o", "w.zarr", "--radius", "0.25"]);
    assert!(wide.contains("radius 0.25 to 0.25"), "{wide}");
    for (options, parts) in [
        (&["--mode", "raycast"][..], &["need cells", "points alone"][..]),
        (&["--mode", "havs"], &["need cells"]),
        (&["--mode", "reference"], &["need cells"]),
        (&["--mode", "points", "--footprint", "exact"], &["--footprint exact", "circle"]),
        (&["--iso", "1"], &["isosurfaces need cells"]),
        (&["--mode", "points", "--sampling", "greedy"], &["--sampling greedy", "global"]),
    ] {
        let words = [&["render", "c.zarr", "-o", "f.png", "--steps", "1"], &size[..], options].concat();
        place.refuses(&words, parts);
    }
    place
        .refuses(&["export", "c.zarr", "-o", "f.ply", "--field", "T", "--iso", "1", "--steps", "0"], &["points alone"]);
    for (option, size) in
        ["--radius", "--volume"].into_iter().flat_map(|of| ["0", "-1", "nan", "inf"].map(|size| (of, size)))
    {
        let run = place.run(&["import", &data("cloud.npz"), "-o", "f.zarr", option, size]);
        assert_eq!((run.code, place.path("f.zarr").exists()), (Some(2), false), "{option} {size}");
        assert!(run.err.contains(option) && run.err.contains("no number above 0"), "{}", run.err);
    }
    let gradient = ["import", &data("cloud.npz"), "-o", "f.zarr", "--field", "T:gradient"];
    place.refuses(&gradient, &["gradients need cells"]);
    place.ok(&["import", &data("cloud.npz"), "-o", "d.zarr", "--define", "x = coords[0] + T", "--field", "x"]);
    for option in ["--radius", "--volume"] {
        place.refuses(&["import", &data("stored.npz"), "-o", "f.zarr", option, "1"], &["mesh of cells", option]);
    }
}

/// A file of one XDMF topology of points.
fn xdmf(topology: &str) -> String {
    let item = |dims: &str, text: &str| {
        format!("<DataItem Dimensions=\"{dims}\" Precision=\"8\" Format=\"XML\">{text}</DataItem>")
    };
    format!(
        "<Xdmf Version=\"3.0\"><Domain><Grid>{topology}<Geometry GeometryType=\"XYZ\">{}</Geometry>\
         <Attribute Name=\"s\" Center=\"Node\">{}</Attribute><Attribute Name=\"radius\" Center=\"Node\">{}</Attribute>\
         </Grid></Domain></Xdmf>",
        item("6 3", "0 0 0 1 0 0 0 1 0 0 0 1 1 1 0 1 0 1"),
        item("6", "0 1 2 3 4 5"),
        item("6", "0.1 0.2 0.3 0.2 0.1 -1")
    )
}

#[test]
fn vertices_of_other_formats_are_clouds() {
    let place = Place::empty();
    let list = "<DataItem Dimensions=\"6\" NumberType=\"Int\" Format=\"XML\">5 4 3 2 1 0</DataItem></Topology>";
    let of = |attributes: &str, rest: &str| xdmf(&format!("<Topology TopologyType={attributes}>{rest}"));
    let pair = list.replace("Dimensions=\"6\"", "Dimensions=\"10\"").replace("5 4 3 2 1 0", "1 2 0 1 1 4 2 3 4 5");
    let legacy = |cells: &str| {
        format!(
            "# vtk DataFile Version 3.0\ncloud\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 double\n\
             0 0 0 1 0 0 0 1 0 0 0 1 1 1 0 1 0 1\n{cells}\nPOINT_DATA 6\nSCALARS s float 1\nLOOKUP_TABLE default\n\
             0 1 2 3 4 5\nSCALARS radius double 1\nLOOKUP_TABLE default\n0.1 0.2 0.3 0.2 0.1 -1\n"
        )
    };
    for (name, text) in [
        ("a.xdmf", of("\"Polyvertex\" NumberOfElements=\"6\"", "</Topology>")),
        ("a.xdmf", of("\"POLYVERTEX\" NumberOfElements=\"1\" NodesPerElement=\"6\"", "</Topology>")),
        ("a.xdmf", of("\"Polyvertex\" NumberOfElements=\"3\"", list)),
        ("a.xdmf", of("\"Polyvertex\"", list)),
        ("a.xdmf", of("\"Mixed\" NumberOfElements=\"2\"", &pair)),
        ("a.vtk", legacy("CELLS 1 7\n6 0 1 2 3 4 5\nCELL_TYPES 1\n2")),
        ("a.vtk", legacy("CELLS 6 12\n1 0 1 1 1 2 1 3 1 4 1 5\nCELL_TYPES 6\n1 1 1 1 1 1")),
    ] {
        std::fs::write(place.path(name), &text).unwrap();
        let said = place.ok(&["import", name, "-o", "v.zarr", "--overwrite"]);
        assert!(said.contains("5 points, radius 0.1 to 0.3") && said.contains("above zero dropped: 1"), "{said}{text}");
        assert!(!said.contains("skipped"), "{said}");
    }
    for (attributes, rest, part) in [
        ("\"Polyvertex\" NumberOfElements=\"7\"", "</Topology>", "7 cells of 1 points, but there are 6"),
        (
            "\"Polyvertex\" NumberOfElements=\"4000000000\" NodesPerElement=\"9000000000\"",
            "</Topology>",
            "but there are 6",
        ),
        ("\"Polyvertex\" NumberOfElements=\"4\"", list, "has 6 points for 4 cells of 1"),
        ("\"Polyvertex\"", "</Topology>", "lacks its NumberOfElements"),
        ("\"Polyvertex\"", &list.replace('5', "6"), "has vertex 6, but there are 6 points"),
        ("\"Polyvertex\" BaseOffset=\"1\"", list, "point 0 is below the BaseOffset 1"),
    ] {
        std::fs::write(place.path("b.xdmf"), of(attributes, rest)).unwrap();
        place.refuses(&["import", "b.xdmf", "-o", "f.zarr"], &["b.xdmf", part]);
    }
    // Beside cells with a volume they are no mesh.
    let with_tet = list.replace("Dimensions=\"6\"", "Dimensions=\"8\"").replace("5 4 3 2 1 0", "1 1 4 6 0 1 2 3");
    let text = of("\"Mixed\" NumberOfElements=\"2\"", &with_tet);
    std::fs::write(place.path("a.xdmf"), text).unwrap();
    let said = place.ok(&["import", "a.xdmf", "-o", "v.zarr", "--overwrite"]);
    assert!(said.contains("mesh: 1 cell, 4 vertices"), "{said}");
}

#[test]
fn an_exported_cloud_is_imported_as_the_same() {
    let place = Place::empty();
    for (name, options) in [("r", &[][..]), ("v", &["--volume", "0.02"])] {
        let stores = ["", "2", "3"].map(|which| format!("{name}{which}.zarr"));
        let file = |which: usize| format!("{name}{which}.pvd");
        // Radii are estimated, and no field.
        place.ok(&[&["import", &data("cloud.npz"), "-o", &stores[0]], options].concat());
        place.ok(&["export", &stores[0], "-o", &file(1)]);
        place.ok(&["import", &file(1), "-o", &stores[1], "--field", "T"]);
        place.ok(&["export", &stores[1], "-o", &file(2), "--field", "T", "--steps", "1"]);
        place.ok(&["import", &file(2), "-o", &stores[2]]);
        let arrays: &[&str] = if options.is_empty() { &["points", "radii"] } else { &["points", "radii", "filling"] };
        for array in arrays {
            let chunk = |store: &String| {
                let folder = place.path(store).join("mesh/0").join(array);
                let chunk = if *array == "points" { "c/0/0" } else { "c/0" };
                (std::fs::read(folder.join(chunk)).unwrap(), std::fs::read(folder.join("zarr.json")).unwrap())
            };
            let [first, second, third] = stores.each_ref().map(chunk);
            assert!(first == second && first == third, "{name} {array}");
        }
        let read = |at: usize| std::fs::read(place.path(&stores[at]).join("mesh/0/vertex_permutation/c/0")).unwrap();
        assert!(read(0) == read(1) && read(0) == read(2));
    }
    // Fields of these names are exported as they are.
    place.ok(&["export", "r3.zarr", "-o", "fields.pvd"]);
    let text = std::fs::read(place.path("fields/fields_0000.vtu")).unwrap();
    let times = text.windows(15).filter(|part| part == b"Name=\"radius\" f").count();
    assert_eq!(times, 1);
}

#[test]
fn clouds_of_vtkhdf_are_imported_drawn_and_exported() {
    let place = Place::empty();
    let cloud = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vtkhdf/cloud.vtkhdf");
    let said = place.ok(&["import", cloud.to_str().unwrap(), "-o", "h.zarr", "--field", "T"]);
    assert!(said.contains("8 points, radius 0.1 to 0.8") && !said.contains("skipped"), "{said}");
    // Its last vertices are one cell: that of a .vtu of the same points has the same cloud.
    place.ok(&["export", "h.zarr", "-o", "e.pvd"]);
    place.ok(&["import", "e.pvd", "-o", "e.zarr", "--field", "T"]);
    let [first, second] = ["h.zarr", "e.zarr"].map(|store| {
        let image = format!("{store}.png");
        let look = ["--steps", "2", "--size", "48x48", "--tf", "viridis@0:0.1,1:0.3"];
        place.ok(&[&["render", store, "-o", &image][..], &look].concat());
        let info = place.json(&["info", store, "--json"]);
        assert_eq!((&info["mesh"]["kind"], &info["time"]["steps"]), (&"points".into(), &3.into()));
        std::fs::read(place.path(&image)).unwrap()
    });
    assert!(first == second);
}

#[test]
fn points_have_the_volumes_of_the_field_or_the_option() {
    let place = Place::empty();
    let with_volumes = vertices("1 1 1 1 1 1", "1 2 3 4 5 6").replace("Name=\"s\"", "Name=\"volume\"");
    std::fs::write(place.path("v.vtu"), with_volumes).unwrap();
    // The last point has no radius, the first no volume.
    let said = place.ok(&["import", "v.vtu", "-o", "v.zarr"]);
    let parts = ["4 points, radius 0.1 to 0.3, volume 1 to 4", "without a volume above zero dropped: 1"];
    assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    let info = place.ok(&["info", "v.zarr"]);
    assert!(info.starts_with("cloud    4 points, radius 0.1 to 0.3, volume 1 to 4"), "{info}");
    assert_eq!(place.json(&["info", "v.zarr", "--json"])["mesh"]["repair"]["cloud"]["without_volume"], 1);
    let said = place.ok(&["import", "v.vtu", "-o", "w.zarr", "--volume", "0.5"]);
    assert!(said.contains("5 points, radius 0.1 to 0.3, volume 0.5 to 0.5"), "{said}");
    // Those of NumPy: the first point has none.
    let said = place.ok(&["import", &data("filled.npz"), "-o", "n.zarr"]);
    let parts = ["7 points, radius 0.2 to 0.8, volume 0.5 to 3.5", "without a volume above zero dropped: 1"];
    assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    let said = place.ok(&["import", "v.vtu", "-o", "a.zarr", "--append", "--volume", "0.5"]);
    assert!(said.contains("5 points, radius 0.1 to 0.3, volume 0.5 to 0.5"), "{said}");
}

#[test]
fn points_are_drawn_as_functions_where_they_are_dense() {
    let place = Place::empty();
    place.ok(&["import", &data("cloud.npz"), "-o", "c.zarr"]);
    let drawn = |rest: &[&str]| {
        let words = ["render", "c.zarr", "-o", "f.exr", "--exr", "raw", "--steps", "1", "--size", "32x32"];
        place.ok(&[&words[..], &["--tf", "viridis@0:0.1,1:0.3"], rest].concat());
        read_exr(&place.path("f.exr")).unwrap().planes
    };
    let sheets = drawn(&["--mode", "sheets", "--sampling-error", "1e-5"]);
    let judge = drawn(&["--mode", "reference", "--representation", "vertices"]);
    println!("{:.1e}", apart(&sheets, &judge));
    assert!(apart(&sheets, &judge) <= 1e-3 && judge.color.pixels.iter().any(|p| p[3] > 0.1));
    // The comparison can fail: balls, and a box, are other pictures.
    assert!(apart(&drawn(&[]), &judge) > 1e-2);
    assert!(apart(&drawn(&["--representation", "vertices", "--domain", "box"]), &judge) > 1e-2);
    let refused = |options: &[&str], parts: &[&str]| {
        place.refuses(&[&["render", "c.zarr", "-o", "g.png", "--steps", "1"], options].concat(), parts);
    };
    refused(&["--mode", "sheets", "--domain", "mesh"], &["no mesh", "--domain box or coverage"]);
    refused(&["--mode", "reference"], &["need cells"]);
}

//! Mesh files of every kind, good and bad.
use super::*;
use proptest::prelude::{any, prop, proptest};

const OBJ: &str = "o roof\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\n\
                   f 1 2 3 4\nl 1 2\nf 1/1/1 2 5\nf -3 -2 -1\n";
const STL: &str = "solid roof\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\n\
                   endfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\n\
                   endfacet\nendsolid roof\n";

/// A square of 1 m by 2 m, shown twice: by nodes that scale, move and turn it, and in an own unit.
const DAE: &str = r##"<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="tile"><mesh>
<source id="s"><float_array id="a" count="12">0 0 0 100 0 0 100 200 0 0 200 0</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>0 1 2 3</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene">
<node id="n"><translate>0 0 50</translate><rotate>0 0 1 90</rotate><node><instance_geometry url="#tile"/></node></node>
<node><matrix>0.5 0 0 100 0 0.5 0 0 0 0 0.5 0 0 0 0 1</matrix><instance_geometry url="#tile"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>"##;

/// Two triangles of the unit square. The header begins with `solid`, as some programs write it.
fn binary_stl() -> Vec<u8> {
    let mut bytes = b"solid made by a program".to_vec();
    bytes.resize(80, b' ');
    bytes.extend(2_u32.to_le_bytes());
    for corners in [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
        [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
    ] {
        bytes.extend([0; 12]);
        bytes.extend(corners.as_flattened().iter().flat_map(|c: &f32| c.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn read_bytes(ending: &str, bytes: &[u8], factor: f64) -> Result<Mesh, Refusal> {
    parse(Path::new("part"), ending, bytes, Scale { factor, is_stated: false })
}

fn area_m2(mesh: &Mesh) -> f64 {
    let corner = |i: u32| mesh.vertices_m[usize::try_from(i).unwrap()];
    let area =
        |[a, b, c]: &[u32; 3]| 0.5 * (corner(*b) - corner(*a)).cross(&(corner(*c) - corner(*a))).norm();
    mesh.triangles.iter().map(area).sum()
}

#[test]
fn mesh_of_each_format_has_its_triangles_and_scale() {
    let nameless = STL.replacen("solid roof", "solid", 1);
    let windows = nameless.replace('\n', "\r\n");
    let files = [binary_stl(), STL.into(), nameless.into(), windows.into()].map(|bytes| ("stl", bytes));
    for (ending, bytes) in files.into_iter().chain([("obj", OBJ.into())]) {
        let mesh = read_bytes(ending, &bytes, 0.5).unwrap();
        let expected = if ending == "obj" { (5, 4) } else { (4, 2) };
        assert_eq!((mesh.vertices_m.len(), mesh.triangles.len()), expected);
        let square_m2 = if ending == "obj" { 0.25 + 2.0 * 0.25 * 0.5 * 1.25_f64.sqrt() } else { 0.25 };
        assert!((area_m2(&mesh) - square_m2).abs() < 1e-12, "{}", area_m2(&mesh));
    }
}

/// Goal: every solid of a file counts. Method: the same square, 1 m and 10 m away, as solids, objects and groups.
#[test]
fn mesh_of_several_solids_objects_or_groups_has_the_facets_of_all() {
    let second = STL.replace("vertex 1 ", "vertex 3 ").replace("vertex 0 ", "vertex 2 ");
    let solids = format!("{STL}{second}");
    let marked = format!("\u{feff}{solids}");
    let loud = solids.to_uppercase();
    for text in [&solids, &marked, &loud] {
        let mesh = read_bytes("stl", text.as_bytes(), 1.0).unwrap();
        assert_eq!((mesh.vertices_m.len(), mesh.triangles.len()), (8, 4), "{text}");
        let far_m = mesh.vertices_m.iter().map(|v| v.x).fold(0.0, f64::max);
        assert!((far_m - 3.0).abs() < 1e-12, "{far_m}");
    }
    let (square, other) = ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n", "v 2 0 0\nv 3 0 0\nv 3 1 0\nv 2 1 0\n");
    for parts in ["o a\nf 1 2 3 4\no b\nf 5 6 7 8\n", "g a\nf 1 2 3 \\\n4\ng b c\nusemtl x\nf -4 -3 -2 -1\n"]
    {
        for mark in ["", "\u{feff}"] {
            let mesh = read_bytes("obj", format!("{mark}{square}{other}{parts}").as_bytes(), 1.0).unwrap();
            assert_eq!((mesh.vertices_m.len(), mesh.triangles.len()), (8, 4), "{parts}");
        }
    }
}

/// Goal: a negative index counts back from its line, not from the end of the file.
#[test]
fn obj_negative_indices_count_back_from_the_line_that_they_stand_in() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 3 0 0\nv 4 0 0\nv 4 1 0\nf -3 -2 -1\n";
    let mesh = read_bytes("obj", text.as_bytes(), 1.0).unwrap();
    let corners = mesh.triangles.iter().map(|t| t.map(|corner| mesh.vertices_m[corner as usize].x));
    assert_eq!(corners.collect::<Vec<_>>(), [[0.0, 1.0, 1.0], [3.0, 4.0, 4.0]]);
}

#[test]
fn dae_is_read_with_its_nodes_and_unit() {
    for text in [DAE.to_owned(), format!("\u{feff}{DAE}"), DAE.replace("collada.org", "example.org")] {
        let mesh = read_bytes("dae", text.as_bytes(), 1.0).unwrap();
        let at = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
        let expected = [
            [at(0.0, 0.0, 0.5), at(0.0, 1.0, 0.5), at(-2.0, 1.0, 0.5), at(-2.0, 0.0, 0.5)],
            [at(1.0, 0.0, 0.0), at(1.5, 0.0, 0.0), at(1.5, 1.0, 0.0), at(1.0, 1.0, 0.0)],
        ];
        assert_eq!(mesh.triangles.len(), 4);
        for (found, wanted) in mesh.vertices_m.iter().zip(expected.as_flattened()) {
            assert!((found - wanted).norm() < 1e-12, "{found} for {wanted}");
        }
    }
    let polygons = DAE.replace("<vcount>4</vcount>", "").replace("polylist", "polygons");
    let fans = polygons.replace("polygons", "trifans");
    let strips = fans.replace("trifans", "tristrips").replace("0 1 2 3</p>", "0 1 3 2</p>");
    let triangles = strips.replace("tristrips", "triangles").replace("0 1 3 2</p>", "0 1 2 0 2 3</p>");
    for text in [polygons, fans, strips, triangles] {
        let mesh = read_bytes("dae", text.as_bytes(), 1.0).unwrap();
        assert_eq!(mesh.triangles.len(), 4);
        assert!((area_m2(&mesh) - 2.5).abs() < 1e-12, "{text}");
    }
}

/// Goal: triangles behind a comment count. Method: the tile's list of triangles with a comment, and with an instruction, in it.
#[test]
fn dae_with_comments_among_its_numbers_loses_none() {
    let triangles = DAE.replace("<vcount>4</vcount>", "").replace("polylist", "triangles");
    for between in ["<!-- second -->", "<?part two?>", "<![CDATA[ ]]>"] {
        let list = format!("<p>0 1 2 {between} 0 2 3</p>");
        let text =
            triangles.replace("<p>0 1 2 3</p>", &list).replace("0 0 50<", &format!("0 {between} 0 50<"));
        let text = text.replace("Z_UP<", &format!("{between}Z_UP<"));
        let mesh = read_bytes("dae", text.as_bytes(), 1.0).unwrap();
        assert_eq!(mesh.triangles.len(), 4, "{between}");
        assert!((area_m2(&mesh) - 2.5).abs() < 1e-12, "{between}");
    }
}

#[test]
fn bad_mesh_is_refused_with_words_that_help() {
    let binary = binary_stl();
    let mut cut = binary.clone();
    cut.truncate(120);
    let mut infinite = binary.clone();
    infinite[96..100].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let mut huge = binary.clone();
    huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut empty = binary[..84].to_vec();
    empty[80..84].fill(0);
    let cases: [(&str, Vec<u8>, f64, &str); 28] = [
        ("stl", Vec::new(), 1.0, "is 0 bytes long"),
        ("stl", cut, 1.0, "120 bytes long, and its header means 184"),
        ("stl", huge, 1.0, "its header means 214748364834"),
        ("stl", infinite, 1.0, "finite coordinates"),
        ("stl", empty, 1.0, "has no triangles"),
        ("stl", binary, 1000.0, "millimetres want scale"),
        ("stl", STL.replace("vertex 1 0 0", "vertex 1 1 0").into(), 1.0, "degenerate triangle, number 0"),
        ("stl", STL.replace("vertex 1 0 0", "vertex 1 nan 0").into(), 1.0, "three finite numbers"),
        ("stl", "solid x\nendsolid x\n".into(), 1.0, "has no triangles"),
        ("obj", Vec::new(), 1.0, "has no triangles"),
        ("obj", OBJ.replace("f 1 2 3 4", "f 1 2 9").into(), 1.0, "is not OBJ"),
        ("obj", OBJ.replace("f 1 2 3 4", "f 1 2 0").into(), 1.0, "is not OBJ"),
        ("obj", OBJ.replace("v 1 0 0", "v nan 0 0").into(), 1.0, "finite coordinates"),
        ("obj", OBJ.replace("f 1 2 3 4", "f 1 2 2").into(), 1.0, "degenerate triangle"),
        ("stl", STL.replace("endsolid roof\n", "").into(), 1.0, "ends inside a solid, after 2 facets"),
        ("stl", STL.replacen("vertex 1 0 0\n", "", 1).into(), 1.0, "three vertices in each facet"),
        ("stl", format!("{STL}facet normal 0 0 1\n").into(), 1.0, "line 17: \"facet normal 0 0 1\""),
        ("stl", STL.replace("endloop", "colour 1 2 3\nendloop").into(), 1.0, "`vertex` or `endloop`"),
        ("stl", STL.into(), 90.0, "90.0000 x 90.0000 x 0.0000 m large"),
        ("stl", STL.into(), 6.0, "scale = 0.001"),
        ("stl", STL.into(), 1e-4, "probably scaled twice"),
        ("obj", OBJ.replace("l 1 2", "surf 0 1 0 1 1 2 3 4").into(), 1.0, "line 8: \"surf 0 1"),
        ("dae", DAE.replace("0 1 2 3</p>", "0 1 2 9</p>").into(), 1.0, "an index beyond its positions"),
        ("dae", DAE.replace("#tile", "tile.dae#tile").into(), 1.0, "the id of an element of this file"),
        ("dae", DAE.replace("translate", "skew").into(), 1.0, "<skew> is a transform that is not read"),
        ("dae", DAE.replace("Z_UP", "Y_UP").into(), 1.0, "has up_axis Y_UP"),
        ("dae", DAE.replace("<vcount>4", "<vcount>5").into(), 1.0, "a <vcount> that fits its <p>"),
        (
            "dae",
            DAE.replace("<node><inst", "<node><instance_node url=\"#n\"/><inst").into(),
            1.0,
            "too often or too deep",
        ),
    ];
    for (i, (ending, bytes, scale, words)) in cases.into_iter().enumerate() {
        let (value, expected) = read_bytes(ending, &bytes, scale).expect_err("a bad mesh");
        assert!(
            format!("{value}: expected {expected}").contains(words),
            "case {i}: {value}: expected {expected}"
        );
    }
}

proptest! {
    #![proptest_config(proptest::test_runner::Config { cases: 2000, failure_persistence: None, ..Default::default() })]

    #[test]
    fn mutated_mesh_never_panics_and_never_passes_unsound(
        which in 0..4_usize,
        edits in prop::collection::vec((any::<usize>(), 0..12_usize, prop::collection::vec(any::<u8>(), 0..12)), 1..5),
    ) {
        let (ending, mut bytes) = [("stl", binary_stl()), ("stl", STL.into()), ("obj", OBJ.into()), ("dae", DAE.into())][which].clone();
        for (at, cut, put) in edits {
            // A character of the format's own alphabet reaches deeper than a random byte.
            let put = put.into_iter().map(|b| if b % 2 == 0 { b"0123456789-/ \nvfe.solx"[usize::from(b) % 22] } else { b });
            let at = at % (bytes.len() + 1);
            let end = (at + cut).min(bytes.len());
            bytes.splice(at..end, put);
        }
        if let Ok(mesh) = read_bytes(ending, &bytes, 1.0) {
            let corners = u32::try_from(mesh.vertices_m.len()).unwrap();
            assert!(!mesh.triangles.is_empty() && mesh.triangles.iter().flatten().all(|corner| *corner < corners));
            assert!(mesh.vertices_m.iter().flat_map(|v| v.iter()).all(|c| c.abs() <= REACH_M_MAX));
        }
    }
}

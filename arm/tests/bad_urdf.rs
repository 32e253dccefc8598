//! URDF, SRDF and mesh files that are wrong: each is refused with file, element and value, and none makes a reader panic.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
use proptest::prelude::{any, prop, proptest};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use taustream_arm::{Faults, Robot};
use taustream_motion::MAX_JOINTS;

/// An arm of two joints with every kind of element; small, because thousands of its edits are read.
const URDF: &str = r#"<?xml version="1.0"?>
<robot name="two">
  <link name="root"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="one" type="revolute">
    <parent link="root"/><child link="arm"/>
    <origin xyz="0 0 0.1" rpy="0 0.2 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="3" effort="9"/>
  </joint>
  <link name="arm">
    <inertial><mass value="1.5"/><origin xyz="0 0 0.1"/></inertial>
    <collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.03" length="0.3"/></geometry></collision>
  </link>
  <joint name="two" type="continuous">
    <parent link="arm"/><child link="hand"/><origin xyz="0 0 0.3"/><axis xyz="1 0 0"/><limit velocity="3" effort="9"/>
  </joint>
  <link name="hand"><collision><geometry><mesh filename="hand.stl" scale="1 1 1"/></geometry></collision></link>
  <joint name="tip_joint" type="fixed"><parent link="hand"/><child link="tip"/><origin xyz="0 0 0.1"/></joint>
  <link name="tip"/>
  <joint name="finger_joint" type="prismatic">
    <parent link="hand"/><child link="finger"/><axis xyz="0 1 0"/><limit lower="0" upper="0.1" velocity="1" effort="1"/>
    <mimic joint="one" offset="0.01"/>
  </joint>
  <link name="finger"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
</robot>
"#;
const SRDF: &str =
    "<robot name=\"two\"><disable_collisions link1=\"arm\" link2=\"finger\" reason=\"Never\"/></robot>\n";
const ROBOT: &str = "name = \"two\"\nurdf = \"two.urdf\"\nsrdf = \"two.srdf\"\ntip_link = \"tip\"\n\
    [[joint]]\nname = \"one\"\nmotion = { acceleration_rad_s2 = 10, jerk_rad_s3 = 100 }\n\
    [[joint]]\nname = \"two\"\nposition_rad = [-3, 3]\nmotion = { acceleration_rad_s2 = 10, jerk_rad_s3 = 100 }\n";
/// A tetrahedron.
const STL: &str = "solid t\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0.1 0\nvertex 0.1 0 0\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0.1 0 0\nvertex 0 0 0.1\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 0.1\nvertex 0 0.1 0\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0.1 0 0\nvertex 0 0.1 0\nvertex 0 0 0.1\nendloop\nendfacet\nendsolid t\n";

/// A folder of its own with all four files.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("taustream-bad-urdf-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let folder = Self(folder);
        for (file, text) in [("two.urdf", URDF), ("two.srdf", SRDF), ("two.toml", ROBOT), ("hand.stl", STL)] {
            folder.write(file, text.as_bytes());
        }
        folder
    }
    fn write(&self, file: &str, bytes: &[u8]) {
        fs::write(self.0.join(file), bytes).expect("a file");
    }
    fn load(&self) -> Result<Robot, Faults> {
        Robot::load(&self.0.join("two.toml"))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Left behind, it does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// File, text to replace, replacement, words of the refusal.
type Case = (&'static str, &'static str, &'static str, &'static [&'static str]);

const CASES: &[Case] = &[
    // What is not XML, or not a URDF.
    ("two.urdf", "</robot>", "", &["two.urdf", "not XML"]),
    ("two.urdf", "<robot name=\"two\">", "<robot name=\"two\"><oops></ooops>", &["not XML"]),
    (
        "two.urdf",
        "<robot name=\"two\">",
        "<!DOCTYPE r [<!ENTITY a \"aa\">]><robot name=\"two\">",
        &["not XML", "document type"],
    ),
    (
        "two.urdf",
        "<robot name=\"two\">",
        "<robot name=\"two\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:include filename=\"a\"/>",
        &["two.urdf:2", "the xacro element \"include\"", "expand it first"],
    ),
    (
        "two.urdf",
        "<robot name=\"two\">",
        "<robot name=\"two\"><xacro:include filename=\"a\"/>",
        &["not XML", "xacro FILE"],
    ),
    ("two.urdf", "<?xml version=\"1.0\"?>\n<robot name=\"two\">", "<sdf><robot name=\"two\">", &["not XML"]),
    ("two.urdf", "<robot name=\"two\">", "<robot>", &["robot.name = missing"]),
    // Numbers.
    (
        "two.urdf",
        "xyz=\"0 0 0.15\"",
        "xyz=\"0 nan 0.15\"",
        &["two.urdf:11", "link arm.collision[0].origin.xyz[1] = NaN"],
    ),
    ("two.urdf", "xyz=\"0 0 0.15\"", "xyz=\"0 0\"", &["origin.xyz = [0.0, 0.0] (2 values)", "3 numbers"]),
    ("two.urdf", "xyz=\"0 0 0.15\"", "xyz=\"0 0 ${z}\"", &["xyz[2] = \"${z}\"", "a finite number"]),
    ("two.urdf", "xyz=\"0 0 0.15\"", "xyz=\"0 0 1e300\"", &["from -100 to 100 m"]),
    ("two.urdf", "rpy=\"0 0.2 0\"", "rpy=\"0 inf 0\"", &["joint one.origin.rpy[1] = inf"]),
    ("two.urdf", "radius=\"0.03\"", "radius=\"0\"", &["cylinder.radius = 0.0", "above 0"]),
    ("two.urdf", "radius=\"0.03\"", "radius=\"-0.03\"", &["cylinder.radius = -0.03"]),
    ("two.urdf", " length=\"0.3\"", "", &["cylinder.length = missing"]),
    (
        "two.urdf",
        "size=\"0.1 0.1 0.1\"",
        "size=\"0.1 0 0.1\"",
        &["link root.collision[0].geometry.box.size[1] = 0.0"],
    ),
    ("two.urdf", "value=\"1.5\"", "value=\"-1.5\"", &["link arm.inertial.mass.value = -1.5"]),
    (
        "two.urdf",
        "value=\"1.5\"/>",
        "value=\"1.5\"/><inertia ixx=\"nan\"/>",
        &["link arm.inertial.inertia.ixx", "NaN"],
    ),
    (
        "two.urdf",
        "value=\"1.5\"/>",
        "value=\"1.5\"/><inertia ixx=\"1\" iyz=\"much\"/>",
        &["link arm.inertial.inertia.iyz"],
    ),
    ("two.urdf", "value=\"1.5\"/>", "value=\"1.5\"/><inertia/><inertia/>", &["given twice"]),
    ("two.urdf", "lower=\"-2\"", "lower=\"5\"", &["joint one.limit.lower = 5.0", "at most the upper limit"]),
    ("two.urdf", "velocity=\"3\"", "velocity=\"-3\"", &["joint one.limit.velocity = -3.0"]),
    (
        "two.urdf",
        "velocity=\"3\"",
        "velocity=\"0\"",
        &["joint[0].motion.velocity_rad_s = missing, and the URDF's limit.velocity is 0", "nobody knew it"],
    ),
    ("two.urdf", " velocity=\"3\"", "", &["missing, and the URDF states no limit.velocity", "state it here"]),
    (
        "two.toml",
        "acceleration_rad_s2 = 10, ",
        "",
        &["joint[0].motion.acceleration_rad_s2 = missing, and the URDF states no limit.acceleration"],
    ),
    ("two.urdf", "effort=\"9\"", "effort=\"much\"", &["joint one.limit.effort = \"much\""]),
    ("two.urdf", "effort=\"9\"", "jerk=\"-1\"", &["joint one.limit.jerk = -1.0"]),
    ("two.urdf", "effort=\"9\"", "deceleration=\"fast\"", &["joint one.limit.deceleration = \"fast\""]),
    (
        "two.urdf",
        "<axis xyz=\"0 0 1\"/>",
        "<axis xyz=\"0 0 0\"/>",
        &["joint one.axis.xyz = [0.0, 0.0, 0.0]", "not all 0"],
    ),
    ("two.urdf", "scale=\"1 1 1\"", "scale=\"1 0 1\"", &["mesh.scale", "not 0"]),
    // Names, and how links hang together.
    (
        "two.urdf",
        "<link name=\"tip\"/>",
        "<link name=\"tip\"/><link name=\"tip\"/>",
        &["link tip.name = \"tip\"", "each name once"],
    ),
    (
        "two.urdf",
        "<joint name=\"two\"",
        "<joint name=\"one\"",
        &["joint one.name = \"one\"", "each name once"],
    ),
    (
        "two.urdf",
        "<parent link=\"arm\"/>",
        "<parent link=\"arn\"/>",
        &["joint two.parent.link = \"arn\"", "the name of a <link>"],
    ),
    ("two.urdf", "<child link=\"tip\"/>", "<child link=\"arm\"/>", &["child = \"arm\"", "no other joint"]),
    (
        "two.urdf",
        "<parent link=\"root\"/>",
        "<parent link=\"tip\"/>",
        &["link = \"arm\"", "hangs in a circle"],
    ),
    (
        "two.urdf",
        "<parent link=\"hand\"/><child link=\"finger\"/>",
        "<parent link=\"finger\"/><child link=\"finger\"/>",
        &["\"finger\"", "hangs in a circle"],
    ),
    (
        "two.urdf",
        "<link name=\"tip\"/>",
        "<link name=\"tip\"/><link name=\"alone\"/>",
        &["2 roots: \"root\", \"alone\""],
    ),
    ("two.urdf", "name=\"tip\"/>", "name=\"\"/>", &["link \"\".name = \"\""]),
    // What is not supported.
    (
        "two.urdf",
        "type=\"revolute\"",
        "type=\"planar\"",
        &["two.toml", "joint \"one\" (planar) between base and tip", "each has one servo"],
    ),
    (
        "two.urdf",
        "type=\"revolute\"",
        "type=\"prismatic\"",
        &["two.toml", "acceleration_rad_s2", "acceleration_m_s2: the joint is prismatic"],
    ),
    (
        "two.urdf",
        "type=\"revolute\"",
        "type=\"screw\"",
        &["joint one.type = \"screw\"", "revolute, continuous"],
    ),
    (
        "two.urdf",
        "<axis xyz=\"1 0 0\"/>",
        "<axis xyz=\"1 0 0\"/><mimic joint=\"one\"/>",
        &["joint \"two\" (continuous)", "follows joint \"one\"", "linkages"],
    ),
    (
        "two.urdf",
        "<sphere radius=\"0.01\"/>",
        "<cone radius=\"0.01\"/>",
        &["link finger.collision[0].geometry = \"cone\"", "one of <sphere>"],
    ),
    ("two.urdf", "<sphere radius=\"0.01\"/>", "", &["one of <sphere>"]),
    ("two.urdf", "<geometry><sphere radius=\"0.01\"/></geometry>", "", &["collision[0].geometry = missing"]),
    (
        "two.urdf",
        "<origin xyz=\"0 0 0.3\"/>",
        "<origin xyz=\"0 0 0.3\"/><origin/>",
        &["joint two.origin = given twice"],
    ),
    // Meshes.
    ("two.urdf", "hand.stl", "none.stl", &["mesh.filename = \"none.stl\"", "looked at"]),
    ("two.urdf", "hand.stl", "package://nobody/hand.stl", &["package://nobody/hand.stl", "package_dirs"]),
    ("two.urdf", "hand.stl", "https://host/hand.stl", &["nothing is fetched"]),
    ("two.urdf", "hand.stl", "two.srdf", &["is none of .stl, .obj and .dae", "assimp"]),
    ("two.urdf", "scale=\"1 1 1\"", "scale=\"9999 1 1\"", &["hand.stl has corner", "after scaling"]),
    ("hand.stl", "solid t", "sordid t", &["two.urdf:16", "hand.stl is 382 bytes long"]),
    ("hand.stl", "vertex 0 0 0.1", "vertex 0 0 nan", &["hand.stl line 13"]),
    // The SRDF.
    (
        "two.srdf",
        "link1=\"arm\"",
        "link1=\"harm\"",
        &["two.srdf:1", "link1 = \"harm\"", "a link of robot \"two\""],
    ),
    ("two.srdf", " link2=\"finger\"", "", &["link2 = missing"]),
    ("two.srdf", "</robot>", "", &["two.srdf", "not XML"]),
    // The robot file.
    (
        "two.toml",
        "tip_link = \"tip\"",
        "tip_link = \"top\"",
        &["tip_link = \"top\"", "its root is root", "its ends are tip, finger"],
    ),
    (
        "two.toml",
        "tip_link = \"tip\"",
        "tip_link = \"tip\"\nbase_link = \"finger\"",
        &["tip_link = \"tip\"", "hangs on the base link \"finger\""],
    ),
    ("two.toml", "tip_link = \"tip\"", "tip_link = \"root\"", &["0 joints that move"]),
    ("two.toml", "tip_link = \"tip\"", "tip_link = \"tip\"\npackage_dirs = 3", &["package_dirs = 3"]),
    (
        "two.toml",
        "tip_link = \"tip\"",
        "tip_link = \"tip\"\nallowed_contacts = [[\"arm\", \"leg\"]]",
        &["[\"arm\", \"leg\"]", "\"root\", \"arm\""],
    ),
    ("two.toml", "position_rad = [-3, 3]\n", "", &["joint[1].position_rad = missing", "continuous"]),
    (
        "two.toml",
        "name = \"one\"\n",
        "name = \"one\"\nposition_rad = [-2.5, 2]\n",
        &["joint[0].position_rad = [-2.5, 2.0]", "inside the URDF's [-2.0, 2.0]"],
    ),
    (
        "two.toml",
        "name = \"one\"\n",
        "name = \"uno\"\n",
        &["joint[0].name = \"uno\"", "between base and tip: one, two", "name = \"one\""],
    ),
    ("two.toml", "name = \"one\"\n", "name = \"two\"\n", &["each joint's name once"]),
    ("two.toml", "name = \"one\"\n", "name = \"one\"\ndh = { a_m = 0 }\n", &["joint[0].dh", "no such key"]),
    ("two.toml", "acceleration_rad_s2 = 10, ", "", &["joint[0].motion.acceleration_rad_s2 = missing"]),
    ("two.toml", "srdf = \"two.srdf\"", "srdf = \"none.srdf\"", &["none.srdf: no such file"]),
];

#[test]
fn bad_urdf_of_every_kind_is_refused_with_words_that_help() {
    let folder = Folder::new("cases");
    assert!(folder.load().is_ok(), "{}", folder.load().unwrap_err());
    let mut complaints = Vec::new();
    for (i, (file, from, to, words)) in CASES.iter().enumerate() {
        let good = fs::read_to_string(folder.0.join(file)).unwrap();
        assert!(good.contains(from), "case {i}: {from:?} stands nowhere in {file}");
        folder.write(file, good.replacen(from, to, 1).as_bytes());
        match folder.load() {
            Ok(_) => complaints.push(format!("case {i}: {to:?} was taken")),
            Err(faults) => {
                let said = faults.to_string();
                let missing = words.iter().filter(|word| !said.contains(**word));
                complaints
                    .extend(missing.map(|word| format!("case {i}, {to:?}: {word:?} is missing in\n{said}")));
            }
        }
        folder.write(file, good.as_bytes());
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
    assert!(folder.load().is_ok());
}

/// Goal: two faults in one file are both said, so that it can be fixed at once.
#[test]
fn several_faults_of_a_urdf_are_reported_at_once() {
    let folder = Folder::new("several");
    folder.write(
        "two.urdf",
        URDF.replace("0.03", "none").replace("0 0.2 0", "0 0.2").replace("\"1.5\"", "\"x\"").as_bytes(),
    );
    let faults = folder.load().unwrap_err();
    let keys: Vec<&str> = faults.0.iter().map(|fault| fault.key.as_str()).collect();
    let expected = [
        "link arm.collision[0].geometry.cylinder.radius",
        "link arm.inertial.mass.value",
        "joint one.origin.rpy",
    ];
    assert_eq!(keys, expected, "{faults}");
}

#[test]
fn mesh_without_an_inside_is_refused() {
    let folder = Folder::new("meshes");
    let triangle =
        "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n";
    let point =
        "facet normal 0 0 0\nouter loop\nvertex 1 2 3\nvertex 1 2 3\nvertex 1 2 3\nendloop\nendfacet\n";
    for (text, words) in [
        (String::from("solid t\nendsolid t\n"), "has no triangles"),
        (format!("solid t\n{point}endsolid t\n"), "do not lie in one plane"),
        (format!("solid t\n{triangle}{triangle}endsolid t\n"), "do not lie in one plane"),
    ] {
        folder.write("hand.stl", text.as_bytes());
        let faults = folder.load().unwrap_err().to_string();
        assert!(faults.contains(words) && faults.contains("link hand.collision[0]"), "{faults}");
    }
}

/// Files without end are read up to a bound. They are sparse, so they take no room.
#[test]
fn enormous_files_are_refused_unread() {
    let folder = Folder::new("enormous");
    let sparse = |file: &str, bytes: u64| File::create(folder.0.join(file)).unwrap().set_len(bytes).unwrap();
    for (file, bytes) in [("hand.stl", 84 + 50 * 10_000_000), ("two.srdf", 1 << 30), ("two.urdf", 1 << 30)] {
        sparse(file, bytes);
        let faults = folder.load().unwrap_err().to_string();
        assert!(faults.contains(file) && faults.contains("too long"), "{file}: {faults}");
    }
}

#[test]
fn deep_nesting_long_tags_and_crowds_are_refused() {
    let folder = Folder::new("wild");
    let attributes: String = (0..5_000).map(|i| format!(" a{i}=\"\"")).collect();
    for (text, words) in [
        (format!("<robot name=\"r\">{}", "<a>".repeat(200_000)), "too deep"),
        (format!("<robot name=\"r\"{attributes}></robot>"), "too long a tag"),
        (format!("<robot name=\"r\">{}</robot>", "<a/>".repeat(500_000)), "not XML"),
        (format!("<robot name=\"r\">{}</robot>", "<link name=\"l\"/>".repeat(2_000)), "2000 links"),
        (
            format!("<robot name=\"r\"><link name=\"l\">{}</link></robot>", "<collision/>".repeat(2_000)),
            "2000 <collision> elements",
        ),
    ] {
        folder.write("two.urdf", text.as_bytes());
        let faults = folder.load().unwrap_err().to_string();
        assert!(faults.contains(words), "{words:?} is missing in {faults:.300}");
    }
    // What only looks wild is read: a long comment, and tags in a comment and in an attribute.
    let comment = format!("<!-- {} {} -->\n<robot note=\"<a> > b\"", "x".repeat(20_000), "<a>".repeat(100));
    folder.write("two.urdf", URDF.replace("<robot", &comment).replace("<a> > b", "a > b").as_bytes());
    assert!(folder.load().is_ok(), "{}", folder.load().unwrap_err());
}

const PIECES: [&str; 24] = [
    "nan",
    "-inf",
    "1e400",
    "0",
    "<",
    ">",
    "/>",
    "\"",
    "<!--",
    "]]>",
    "&amp;",
    "&x;",
    "<link/>",
    "<joint/>",
    "<robot>",
    "name=\"arm\"",
    "<origin xyz=\"0 0 0\"/>",
    "type=\"fixed\"",
    "type=\"floating\"",
    "\u{0}",
    "\u{202e}",
    "xmlns=\"u\"",
    "<parent link=\"tip\"/>",
    "-",
];

proptest! {
    #![proptest_config(proptest::test_runner::Config { cases: 1500, failure_persistence: None, ..Default::default() })]

    /// Goal: no text makes the reader panic or hang, and what it takes has numbers that can be used.
    #[test]
    fn mutated_urdf_never_panics_and_never_passes_unsound(
        file in 0..4_usize,
        edits in prop::collection::vec((any::<usize>(), 0..60_usize, 0..PIECES.len(), any::<usize>(), 0..120_usize), 1..4),
    ) {
        let folder = Folder::new("mutated");
        let (name, good) = [("two.urdf", URDF), ("two.urdf", URDF), ("two.srdf", SRDF), ("hand.stl", STL)][file];
        let mut text = good.to_owned();
        for (at, cut, piece, from, length) in edits {
            let edge = |at: usize| (at % (text.len() + 1)..=text.len()).find(|i| text.is_char_boundary(*i)).unwrap_or(0);
            let (start, copy) = (edge(at), edge(from));
            let put = if piece % 2 == 0 { PIECES[piece].to_owned() } else { text[copy..].chars().take(length).collect() };
            let end = (start + cut..=text.len()).find(|i| text.is_char_boundary(*i)).unwrap_or(text.len());
            text.replace_range(start..end, &put);
        }
        folder.write(name, text.as_bytes());
        if let Ok(robot) = Robot::load(&folder.0.join("two.toml")) {
            let frames = robot.chain.frames(&[0.5; MAX_JOINTS]);
            assert!(frames.iter().all(|frame| frame.to_homogeneous().iter().all(|n| n.is_finite())));
            let sound = |shape: &taustream_arm::LinkShape| shape.frame <= 2 && shape.link < robot.links.len();
            assert!(robot.shapes.iter().all(sound) && robot.joints.len() == 2);
        }
    }
}

/// The reader's own view of where a file lies must not depend on where it is called from.
#[test]
fn urdf_beside_the_robot_file_is_found_from_anywhere() {
    let folder = Folder::new("beside");
    let robot = Robot::load(&folder.0.join("./../").join(folder.0.file_name().unwrap()).join("two.toml"));
    assert!(robot.is_ok_and(|robot| robot.file.ends_with(Path::new("two.toml"))));
}

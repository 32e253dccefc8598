//! A long table of bad files: each is refused under the key that is wrong, with words that help.
mod bad_files_cases;
mod common;
use bad_files_cases::{Case, axes, cubemars, damiao, feed_forward, robstride, settings};
use common::Reader::{Robot, Scene, Settings, Trajectory};
use common::{Reader, edited, faults_of};

const ROBOT_CASES: &[Case] = &[
    (Robot, "name = \"ur5\"", "name = 5", "name", "= 5: expected a name of 1 to 64"),
    (Robot, "name = \"ur5\"", "", "name", "missing"),
    (Robot, "name = \"ur5\"", "name = \"a b\"", "name", "letters, digits"),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\ncolour = 1", "colour", "no such key; known here are name"),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\nname = \"ur6\"", "", "not TOML"),
    (
        Robot,
        "name = \"ur5\"",
        "name = \"ur5\"\nurdf = \"none.urdf\"\ntip_link = \"t\"",
        "",
        "none.urdf: no such file",
    ),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\nurdf = \"none.urdf\"", "tip_link", "missing"),
    (
        Robot,
        "name = \"ur5\"",
        "name = \"ur5\"\nurdf = 7\ntip_link = \"t\"",
        "urdf",
        "the path of a URDF file",
    ),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\nsrdf = \"ur5.srdf\"", "srdf", "only beside `urdf`"),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\ntip_link = 3", "tip_link", "only beside `urdf`"),
    (Robot, "name = \"shoulder_pan\"", "name = \"elbow\"", "joint[2].name", "each joint's name once"),
    (Robot, "name = \"shoulder_pan\"", "name = \"\"", "joint[0].name", "a name"),
    (Robot, "a_m = -0.425", "a_m = -425", "joint[1].dh.a_m", "from -10 to 10 m"),
    (Robot, "a_m = -0.425", "a_m = nan", "joint[1].dh.a_m", "NaN: expected a finite number"),
    (Robot, "a_m = -0.425", "a_m = -inf", "joint[1].dh.a_m", "-inf: expected a finite number"),
    (Robot, "a_m = -0.425", "a_m = \"-0.425\"", "joint[1].dh.a_m", "a finite number"),
    (Robot, "a_m = -0.425", "a = -0.425", "joint[1].dh.a_m", "missing"),
    (Robot, "a_m = -0.425", "a = -0.425", "joint[1].dh.a", "no such key"),
    (Robot, "a_m = -0.425", "a_m = 99999999999999999999", "joint[1].dh.a_m", "a finite number"),
    (Robot, "a_m = -0.425", "a_m = 2026-01-01", "joint[1].dh.a_m", "the date 2026-01-01"),
    (Robot, "alpha_rad = 1.5707963267948966", "alpha_rad = 90", "joint[0].dh.alpha_rad", "rad"),
    (Robot, "d_m = 0.089159, ", "", "joint[0].dh.d_m", "missing"),
    (Robot, ", theta_offset_rad = 0.0", "", "joint[0].dh.theta_offset_rad", "missing"),
    (Robot, "dh = {", "mdh = {", "joint[1].dh", "one convention for the whole arm"),
    (Robot, "dh = {", "dh = 3\nmhd = {", "joint[0].dh", "= 3: expected a table"),
    (Robot, "dh = {", "mhd = {", "joint[0].dh", "missing: expected a table of a_m"),
    (Robot, "dh = {", "mhd = {", "joint[0].mhd", "no such key"),
    (Robot, "dh = {", "mdh = {}\ndh = {", "joint[0].mdh", "one of dh (standard) and mdh"),
    (
        Robot,
        "link_mass_kg = 3.7",
        "link_mass_kg = 3.7\nlink_radius_m = 0.1",
        "joint[0].link_radius_m",
        "one of the two",
    ),
    (
        Robot,
        "radius_m = 0.0845",
        "radius_m = -0.06",
        "joint[0].link_capsules[0].radius_m",
        "above 0 up to 1 m",
    ),
    (Robot, "base_capsules = [", "base_capsules = [3, ", "base_capsules[0]", "a table"),
    (
        Robot,
        "name = \"ur5\"",
        "name = \"ur5\"\nunmodelled_links = [\"base\"]",
        "unmodelled_links[0]",
        "a link without",
    ),
    (Robot, "torque_nm_max = 150.0", "torque_nm_max = 0.0", "joint[0].torque_nm_max", "above 0"),
    (Robot, "torque_nm_max = 150.0", "torque_nm_max = inf", "joint[0].torque_nm_max", "above 0"),
    (Robot, "torque_nm_max = 150.0", "torque_nm_max = \"150 Nm\"", "joint[0].torque_nm_max", "above 0"),
    (Robot, "link_mass_kg = 3.7", "", "joint[0].link_mass_kg", "missing"),
    (Robot, "link_mass_kg = 3.7", "link_mass_kg = -3.7", "joint[0].link_mass_kg", "from 0 to"),
    (Robot, "link_mass_kg = 3.7", "link_mass_kg = nan", "joint[0].link_mass_kg", "NaN"),
    (Robot, "link_center_m = [0.0, -0.02561, 0.00193]", "", "joint[0].link_center_m", "missing"),
    (Robot, "link_center_m = [0.0, ", "link_center_m = [", "joint[0].link_center_m", "a list of 3 numbers"),
    (
        Robot,
        "link_center_m = [0.0, ",
        "link_center_m = [25.6, ",
        "joint[0].link_center_m[0]",
        "from -10 to 10 m",
    ),
    (
        Robot,
        "link_mass_kg = 3.7\nlink_center_m = [0.0, -0.02561, 0.00193]",
        "",
        "joint[0].link_mass_kg",
        "a mass for each link, or for none",
    ),
    (
        Robot,
        "link_mass_kg = 3.7",
        "link_mass_kg = 3.7\nlink_inertia_kg_m2 = [0.01, 0.01, 0.05, 0.0, 0.0, 0.0]",
        "joint[0].link_inertia_kg_m2",
        "moments [xx, yy, zz, xy, xz, yz] of a body",
    ),
    (
        Robot,
        "link_mass_kg = 3.7",
        "link_mass_kg = 3.7\nlink_inertia_kg_m2 = [0.01, 0.01, 0.01, 0.02, 0.0, 0.0]",
        "joint[0].link_inertia_kg_m2",
        "none negative",
    ),
    (
        Robot,
        "link_mass_kg = 3.7",
        "link_mass_kg = 3.7\nlink_inertia_kg_m2 = [0.01, 0.01, 0.01]",
        "joint[0].link_inertia_kg_m2",
        "a list of 6 numbers",
    ),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\npayload = 3", "payload", "a table"),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\npayload = {}", "payload.mass_kg", "missing"),
    (
        Robot,
        "name = \"ur5\"",
        "name = \"ur5\"\npayload = { mass_kg = 1, center = 0 }",
        "payload.center",
        "no such key",
    ),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\ngravity_m_s2 = 9.81", "gravity_m_s2", "a list of 3 numbers"),
    (Robot, "name = \"ur5\"", "name = \"ur5\"\ngravity_m_s2 = [0, 0, inf]", "gravity_m_s2[2]", "finite"),
    (Robot, "[-3.1416, 3.1416]", "[3.1416, -3.1416]", "joint[0].position_rad", "lowest below the highest"),
    (Robot, "[-3.1416, 3.1416]", "[1.0, 1.0]", "joint[0].position_rad", "lowest below the highest"),
    (
        Robot,
        "[-3.1416, 3.1416]",
        "[-3.1416]",
        "joint[0].position_rad",
        "(1 values): expected a list of 2 numbers",
    ),
    (Robot, "[-3.1416, 3.1416]", "[-180, 180]", "joint[0].position_rad[0]", "rad"),
    (Robot, "[-3.1416, 3.1416]", "3.1416", "joint[0].position_rad", "a list of 2 numbers"),
    (Robot, "velocity_rad_s = 3.14", "velocity_rad_s = 0", "joint[0].motion.velocity_rad_s", "above 0"),
    (
        Robot,
        "velocity_rad_s = 3.14",
        "velocity_rad_s = 180",
        "joint[0].motion.velocity_rad_s",
        "up to 100 rad/s",
    ),
    (Robot, "velocity_rad_s = 3.14, ", "", "joint[0].motion.velocity_rad_s", "missing"),
    (Robot, "motion = {", "motions = {", "joint[0].motion", "missing"),
    (
        Robot,
        "acceleration_rad_s2 = 15.0",
        "acceleration_rad_s2 = -15.0",
        "joint[0].motion.acceleration_rad_s2",
        "above 0",
    ),
    (Robot, "jerk_rad_s3 = 150.0", "jerk_rad_s3 = inf", "joint[0].motion.jerk_rad_s3", "finite"),
    (
        Robot,
        "acceleration_rad_s2 = 30.0",
        "acceleration_rad_s2 = 15.0",
        "joint[0].stop.acceleration_rad_s2",
        "needed for slowing down",
    ),
    (
        Robot,
        "jerk_rad_s3 = 600.0",
        "jerk_rad_s3 = 100.0",
        "joint[0].stop.jerk_rad_s3",
        "more than the motion limit 150.0",
    ),
    (Robot, "stop = {", "stop = { velocity_rad_s = 4.0, ", "joint[0].stop.velocity_rad_s", "no such key"),
    (
        Robot,
        "allowed_contacts = [[\"link3\", \"link5\"], [\"link4\", \"link6\"]]",
        "allowed_contacts = [[\"link3\", \"link9\"]]",
        "allowed_contacts[0]",
        "\"link6\"",
    ),
    (
        Robot,
        "allowed_contacts = [[\"link3\", \"link5\"], [\"link4\", \"link6\"]]",
        "allowed_contacts = [[\"link3\", \"link3\"]]",
        "allowed_contacts[0]",
        "two different links",
    ),
    (
        Robot,
        "allowed_contacts = [[\"link3\", \"link5\"], [\"link4\", \"link6\"]]",
        "allowed_contacts = [[\"link3\"]]",
        "allowed_contacts[0]",
        "two different links",
    ),
    (
        Robot,
        "allowed_contacts = [[\"link3\", \"link5\"], [\"link4\", \"link6\"]]",
        "allowed_contacts = [[\"base\", \"link2\"], [\"link2\", \"base\"]]",
        "allowed_contacts[1]",
        "each pair once",
    ),
    (
        Robot,
        "allowed_contacts = [[\"link3\", \"link5\"], [\"link4\", \"link6\"]]",
        "allowed_contacts = \"all\"",
        "allowed_contacts",
        "a list of pairs",
    ),
    (Robot, "[[joint]]", "[joint.x]\n[joints]", "", "not TOML"),
];

const SCENE_CASES: &[Case] = &[
    (Scene, "margin_m = 0.02", "margin_m = -0.02", "margin_m", "from 0 to 1 m"),
    (Scene, "margin_m = 0.02", "margin_m = nan", "margin_m", "finite"),
    (
        Scene,
        "margin_m = 0.02",
        "margin_mm = 20",
        "margin_mm",
        "no such key; known here are margin_m, sphere, box",
    ),
    (Scene, "name = \"crate\"", "name = \"table\"", "box[5].name", "each obstacle's name once"),
    (Scene, "name = \"crate\"", "name = 7", "box[5].name", "a name"),
    (Scene, "size_m = [0.4, 0.3, 0.3]", "size_m = [0.4, 0.3]", "box[5].size_m", "a list of 3 numbers"),
    (Scene, "size_m = [0.4, 0.3, 0.3]", "size_m = [0.4, 0.0, 0.3]", "box[5].size_m[1]", "above 0"),
    (Scene, "size_m = [0.4, 0.3, 0.3]", "radius_m = 1", "box[5].radius_m", "no such key"),
    (Scene, "size_m = [0.4, 0.3, 0.3]", "radius_m = 1", "box[5].size_m", "missing"),
    (Scene, "center_m = [0.1, 0.6, 0.03]", "", "box[5].center_m", "missing"),
    (Scene, "center_m = [0.1, 0.6, 0.03]", "center_m = [-100.1, 600, inf]", "box[5].center_m[1]", "m"),
    (Scene, "center_m = [0.1, 0.6, 0.03]", "center_m = [-100.1, 600, inf]", "box[5].center_m[2]", "inf"),
    (Scene, "rpy_rad = [0.0, 0.0, 0.3]", "rpy_rad = [0.0, 0.0, 17.2]", "box[5].rpy_rad[2]", "rad"),
    (Scene, "rpy_rad = [0.0, 0.0, 0.3]", "rpy_deg = [0.0, 0.0, 17.2]", "box[5].rpy_deg", "no such key"),
    (Scene, "margin_m = 0.02", "box = 3\nmargin_m = 0.02", "", "not TOML"),
    (Scene, "margin_m = 0.02", "sphere = 3", "sphere", "each begun by [[sphere]]"),
    (Scene, "margin_m = 0.02", "sphere = [3]", "sphere[0]", "a table"),
    (Scene, "margin_m = 0.02", "[[sphere]]\ncenter_m = [1, 1, 1]", "sphere[0].radius_m", "missing"),
    (
        Scene,
        "margin_m = 0.02",
        "[[sphere]]\nradius_m = 0\ncenter_m = [1, 1, 1]",
        "sphere[0].radius_m",
        "above 0",
    ),
    (Scene, "margin_m = 0.02", "[[sphere]]\nrpy_rad = [0, 0, 0]", "sphere[0].rpy_rad", "no such key"),
    (Scene, "margin_m = 0.02", "[[cylinder]]\nradius_m = 1", "cylinder[0].length_m", "missing"),
    (Scene, "margin_m = 0.02", "[[capsule]]\nlength_m = 1", "capsule[0].radius_m", "missing"),
    (Scene, "margin_m = 0.02", "[[mesh]]\ncenter_m = [1, 1, 1]", "mesh[0].file", "missing"),
    (
        Scene,
        "margin_m = 0.02",
        "[[mesh]]\nfile = \"gone.stl\"\ncenter_m = [1, 1, 1]",
        "mesh[0].file",
        "no such file",
    ),
    (
        Scene,
        "margin_m = 0.02",
        "[[mesh]]\nfile = \"shelf.toml\"",
        "mesh[0].file",
        "none of .stl, .obj and .dae",
    ),
    (Scene, "margin_m = 0.02", "[[mesh]]\nfile = \"/dev/zero.stl\"\nscale = 0", "mesh[0].scale", "above 0"),
    (Scene, "margin_m = 0.02", "[[cloud]]\nfile = \"scan.ply\"", "cloud[0].point_radius_m", "missing"),
    (
        Scene,
        "margin_m = 0.02",
        "[[cloud]]\npoint_radius_m = 0.01\nfile = \"shelf.toml\"",
        "cloud[0].file",
        "none of .ply, .pcd and .xyz",
    ),
    (Scene, "margin_m = 0.02", "[[plane]]\nname = \"floor\"", "plane", "no such key"),
];

const TRAJECTORY_CASES: &[Case] = &[
    (Trajectory, "\"version\":1,", "\"version\":2,", "version", "an integer from 1 to 1"),
    (Trajectory, "\"version\":1,", "", "version", "missing"),
    (Trajectory, "\"version\":1,", "\"version\":1,\"speed\":3,", "speed", "no such key"),
    (Trajectory, "\"version\":1,", "\"version\":1,\"joints\":6,", "joints", "each key once"),
    (Trajectory, "\"robot\":\"ur5\"", "\"robot\":null", "robot", "null"),
    (Trajectory, "\"digest\":\"0011", "\"digest\":\"00", "digest", "64 hexadecimal digits"),
    (Trajectory, "\"digest\":\"00", "\"digest\":\"0G", "digest", "64 hexadecimal digits"),
    (Trajectory, "\"digest\":\"", "\"digest\":7,\"x\":\"", "digest", "= 7"),
    (Trajectory, "\"joints\":6", "\"joints\":17", "joints", "an integer from 1 to 16"),
    (Trajectory, "\"joints\":6", "\"joints\":0", "joints", "an integer from 1 to 16"),
    // A seven-joint arm with six values, in every list.
    (Trajectory, "\"joints\":6", "\"joints\":7", "base_rad", "(6 values): expected a list of 7 numbers"),
    (
        Trajectory,
        "\"joints\":6",
        "\"joints\":7",
        "strokes[1].delta_rad",
        "(6 values): expected a list of 7 numbers",
    ),
    (Trajectory, "\"base_rad\":[0.0,", "\"base_rad\":[NaN,", "base_rad[0]", "NaN"),
    (Trajectory, "\"base_rad\":[0.0,", "\"base_rad\":[1e999,", "base_rad[0]", "1e999"),
    (Trajectory, "\"base_rad\":[0.0,", "\"base_rad\":[\"0.0\",", "base_rad[0]", "a finite number"),
    (Trajectory, "\"base_rad\":[0.0,", "\"base_rad\":[100000,", "base_rad[0]", "rad"),
    (Trajectory, "\"base_rad\":", "\"base\":", "base_rad", "missing"),
    (Trajectory, "\"strokes\":[", "\"stroke\":[", "strokes", "missing"),
    (Trajectory, "\"duration_s\":2.5", "\"duration_s\":Infinity", "strokes[0].duration_s", "Infinity"),
    (Trajectory, "\"duration_s\":2.5", "\"duration_s\":-Infinity", "strokes[0].duration_s", "-Infinity"),
    (Trajectory, "\"duration_s\":2.5", "\"duration_s\":0", "strokes[0].duration_s", "from 0.001"),
    (Trajectory, "\"duration_s\":2.5", "\"duration_s\":1e5", "strokes[0].duration_s", "86400"),
    (
        Trajectory,
        "\"start_s\":1.5",
        "\"start_s\":86399",
        "strokes[1].duration_s",
        "a trajectory ends by 86400 s",
    ),
    (Trajectory, "\"start_s\":0", "\"start_s\":2", "strokes[1].start_s", "sorted by start_s"),
    (Trajectory, "\"start_s\":0", "\"start_s\":-1", "strokes[0].start_s", "from 0"),
    (Trajectory, "\"n\":10", "\"n\":3", "strokes[0].n", "an integer from 4 to 64"),
    (Trajectory, "\"n\":10", "\"n\":65", "strokes[0].n", "an integer from 4 to 64"),
    (Trajectory, "\"n\":10", "\"n\":10.0", "strokes[0].n", "an integer"),
    (Trajectory, "\"n\":10", "\"k\":0.1", "strokes[0].k", "no such key"),
    (Trajectory, "\"n\":10", "\"n\":10,\"n\":10", "strokes[0].n", "each key once"),
    (
        Trajectory,
        "[0.5,0.25,0.0,0.0,0.0,0.125]",
        "[0.5,0.25,0.0,0.0,0.0]",
        "strokes[0].delta_rad",
        "(5 values)",
    ),
    (Trajectory, "[0.5,0.25,0.0,0.0,0.0,0.125]", "{}", "strokes[0].delta_rad", "a list of 6 numbers"),
    (Trajectory, "]}]}", "]}]}}", "", "trailing characters"),
    (Trajectory, "]}]}", "", "strokes[1].delta_rad[6]", "ends too early"),
];

#[test]
fn bad_file_is_refused_under_its_key_with_words_that_help() {
    let others = [axes::CASES, damiao::CASES, robstride::CASES, cubemars::CASES, feed_forward::CASES];
    for table in [ROBOT_CASES, SCENE_CASES, settings::CASES, TRAJECTORY_CASES].into_iter().chain(others) {
        for (reader, from, to, key, words) in table {
            let faults = faults_of(*reader, &edited(&reader.good_text(), from, to));
            let hit = faults.0.iter().any(|fault| fault.key == *key && fault.to_string().contains(words));
            assert!(hit, "{from:?} -> {to:?}: no fault under {key:?} with {words:?} in:\n{faults}");
        }
    }
}

#[test]
fn good_file_behind_the_table_has_no_fault() {
    let motors = [Reader::Damiao, Reader::Gripper, Reader::RobStride, Reader::CubeMars];
    for reader in [Robot, Scene, Settings, Trajectory].into_iter().chain(motors) {
        assert_eq!(reader.read(&reader.good_text()), Ok(()), "{reader:?}");
    }
}

#[test]
fn many_faults_in_one_file_are_reported_at_once_with_lines() {
    let mut text = Robot.good_text();
    for (from, to) in
        [("a_m = -0.425", "a_m = nan"), ("name = \"elbow\"", "nome = \"elbow\""), ("0.0823", "823")]
    {
        text = edited(&text, from, to);
    }
    let faults = faults_of(Robot, &text);
    let keys: Vec<&str> = faults.0.iter().map(|fault| fault.key.as_str()).collect();
    assert_eq!(keys, ["joint[1].dh.a_m", "joint[2].name", "joint[2].nome", "joint[5].dh.d_m"]);
    let line_of = |word: &str| text.lines().position(|line| line.contains(word)).map(|at| at + 1);
    assert_eq!(faults.0[0].line, line_of("a_m = nan"));
    assert_eq!(faults.0[3].line, line_of("d_m = 823"));
}

#[test]
fn faults_of_robot_scene_and_settings_come_together() {
    let text = edited(&Settings.good_text(), "../robots/ur5.toml", "../robots/none.toml");
    let text = edited(&text, "../scenes/pillars.toml", "../scenes/none.toml");
    let text = edited(&text, "period_us = 1000", "period_us = 7");
    let faults = faults_of(Settings, &text);
    assert_eq!(faults.0.len(), 3, "{faults}");
    assert!(faults.0[0].file.ends_with("robots/none.toml") && faults.0[1].file.ends_with("scenes/none.toml"));
}

#[test]
fn joint_count_beside_one_to_sixteen_is_refused() {
    let text = Robot.good_text();
    let last = &text[text.rfind("[[joint]]").unwrap()..];
    // Pairs of links need their links.
    let head = text[..text.find("[[joint]]").unwrap()]
        .replace("allowed_contacts = [[\"link3\", \"link5\"], [\"link4\", \"link6\"]]", "");
    for count in [0, 17, 40] {
        let tables: Vec<String> = (0..count).map(|i| last.replace("wrist_3", &format!("j{i}"))).collect();
        let faults = faults_of(Robot, &format!("{head}{}", tables.join("\n")));
        assert_eq!(faults.0.len(), 1, "{faults}");
        assert!(
            faults.to_string().contains(&format!("joint = {count} tables: expected 1 to 16")),
            "{faults}"
        );
    }
    for count in [1, 16] {
        let tables: Vec<String> = (0..count).map(|i| last.replace("wrist_3", &format!("j{i}"))).collect();
        assert_eq!(Robot.read(&format!("{head}{}", tables.join("\n"))), Ok(()));
    }
}

#[test]
fn six_hundred_strokes_are_one_fault() {
    let text = Trajectory.good_text();
    let stroke = r#"{"start_s":0,"duration_s":2.5,"n":10,"delta_rad":[0.5,0.25,0.0,0.0,0.0,0.125]},"#;
    let faults = faults_of(Trajectory, &edited(&text, stroke, &stroke.repeat(599)));
    assert_eq!(faults.0.len(), 1);
    assert!(faults.to_string().contains("strokes = 600 strokes: expected at most 512"), "{faults}");
}

#[test]
fn thousands_of_faults_are_counted_and_not_all_written_out() {
    let keys: Vec<String> = (0..5000).map(|i| format!("k{i} = 1")).collect();
    let faults = faults_of(Scene, &keys.join("\n"));
    assert_eq!(faults.0.len(), 101);
    assert!(faults.to_string().contains("4900 more faults"));
}

#[test]
fn missing_file_says_so_in_one_sentence() {
    let file = common::config().join("settings/none.toml");
    let said = taustream_arm::Settings::load(&file).unwrap_err().to_string();
    assert_eq!(said, format!("{}: no such file: expected a settings file in TOML", file.display()));
}

#[test]
fn endless_or_binary_file_is_refused() {
    let faults = taustream_arm::TrajectoryFile::load(std::path::Path::new("/dev/zero")).unwrap_err();
    assert!(faults.to_string().contains("not a regular file"), "{faults}");
    let directory = std::env::temp_dir().join(format!("taustream-arm-bad-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let file = directory.join("x.toml");
    std::fs::write(&file, b"# fine\nname = \"\xff\xfe\"").unwrap();
    let binary = taustream_arm::Robot::load(&file).unwrap_err();
    std::fs::write(&file, vec![b'#'; (1 << 20) + 1]).unwrap();
    let long = taustream_arm::Scene::load(&file).unwrap_err();
    std::fs::remove_dir_all(&directory).unwrap();
    assert_eq!((binary.0[0].value.as_str(), binary.0[0].line), ("not UTF-8 text", Some(2)));
    assert_eq!(long.0[0].value, "too long");
}

use super::*;
use crate::rng::SeededRng;

fn bits(points: &[[f64; 3]]) -> Vec<[u64; 3]> {
    points.iter().map(|p| p.map(f64::to_bits)).collect()
}

const POINTS: [[f64; 3]; 2] = [[0.5, -1.25, 2.0], [3.0, 0.0, -0.125]];

#[test]
fn every_kind_of_file_gives_the_same_points() {
    #[expect(clippy::cast_possible_truncation, reason = "the numbers are short")]
    let little = |x: f64| (x as f32).to_le_bytes().to_vec();
    let mut pcd = b"# .PCD v0.7\nVERSION 0.7\nFIELDS rgb x y z\nSIZE 4 4 4 4\nTYPE U F F F\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\n".to_vec();
    let mut ply = b"ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty uchar red\nproperty double x\nproperty double y\nproperty double z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n".to_vec();
    for point in POINTS {
        pcd.extend([7, 7, 7, 7]);
        point.iter().for_each(|x| pcd.extend(little(*x)));
        ply.push(9);
        point.iter().for_each(|x| ply.extend(x.to_be_bytes()));
    }
    let ascii = b"ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 2\r\nproperty float z\r\nproperty float x\r\nproperty float y\r\nend_header\r\n2 0.5 -1.25\r\n-0.125 3 0\r\n";
    let text = b"# x y z intensity\n0.5, -1.25, 2, 17\n\n3 0 -0.125\n";
    let written =
        b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\n0.5 -1.25 2\n3 0 -0.125\n";
    let read = [pcd::read(&pcd), ply::read(&ply), ply::read(ascii), self::text(text), pcd::read(written)];
    for (i, points) in read.into_iter().enumerate() {
        assert_eq!(bits(&points.unwrap_or_else(|e| panic!("{i}: {e:?}"))), bits(&POINTS), "reader {i}");
    }
}

/// Goal: no bytes make a reader panic, and a file that is cut short is refused with the numbers.
#[test]
fn cut_and_spoiled_files_are_refused() {
    let header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nHEIGHT 1\nDATA binary\n";
    let short = [header.as_bytes(), &[0; 35]].concat();
    let (value, expected) = pcd::read(&short).expect_err("35 of 36 bytes");
    assert!(value.contains("35") && expected.contains('3'), "{value}, {expected}");
    let huge = header.replace("WIDTH 3", "WIDTH 18446744073709551615");
    assert!(pcd::read(huge.as_bytes()).is_err());
    let squeezed = header.replace("binary", "binary_compressed");
    assert!(pcd::read(squeezed.as_bytes()).expect_err("compressed").1.contains("pcl_convert"));
    let good = [header.as_bytes(), &[1; 36]].concat();
    for seed in 0..2_000 {
        let mut rng = SeededRng::new(seed, 77);
        let mut bytes = good.clone();
        for _ in 0..3 {
            let at = rng.index(bytes.len());
            bytes[at] = u8::try_from(rng.index(256)).unwrap_or(0);
        }
        let cut = rng.index(bytes.len());
        // What comes of it does not matter; that it comes does.
        let _ = (pcd::read(&bytes), ply::read(&bytes), text(&bytes), pcd::read(&bytes[..cut]));
    }
}

#[test]
fn points_without_a_measurement_are_left_out_and_a_cloud_without_points_is_refused() {
    let cloud = Cloud::new(vec![[f64::NAN, 0.0, 0.0], [1.0, 2.0, 3.0]], 0.01).expect("one point");
    assert_eq!((cloud.tree().points().len(), cloud.unmeasured), (1, 1));
    assert!(Cloud::new(vec![[f64::INFINITY; 3]], 0.01).is_err());
    let (value, expected) = Cloud::new(vec![[0.0, 0.0, 1500.0]], 0.01).expect_err("millimetres");
    assert!(value.contains("1500") && expected.contains("scale"), "{value}, {expected}");
}

/// Goal: the tree finds what a look at every point finds.
#[test]
fn nearest_point_is_the_nearest_of_all() {
    for seed in 0..200 {
        let mut rng = SeededRng::new(seed, 78);
        let mut point = || Vector::new(rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), rng.within(-0.1, 0.1));
        let (a, b) = (point(), point());
        let count = 1 + usize::try_from(seed).expect("small") * 3;
        // Many of them in the same place, too.
        let points: Vec<Vector> = (0..count).map(|i| if i % 3 == 0 { a } else { point() }).collect();
        let distance_m = |p: Vector| {
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (p - a - (b - a) * t).length()
        };
        let tree = PointTree::new(points.clone());
        let truth_m = points.iter().map(|p| distance_m(*p)).fold(f64::INFINITY, f64::min);
        let (found_m, index) = tree.nearest(f64::INFINITY, distance_m).expect("some point");
        assert_eq!(found_m.to_bits(), truth_m.to_bits(), "seed {seed}");
        assert_eq!(distance_m(tree.points()[index]).to_bits(), truth_m.to_bits());
        let field = Field::around(&tree);
        for _ in 0..100 {
            let at = 2.0 * point();
            let nearest_m = points.iter().map(|p| (*p - at).length()).fold(f64::INFINITY, f64::min);
            let said_m = [0; 2].map(|_| field.least_m(&tree, at));
            assert!(
                said_m.iter().all(|said_m| *said_m <= nearest_m),
                "seed {seed}: {said_m:?} of {nearest_m}"
            );
        }
        assert_eq!(tree.nearest(truth_m, distance_m), None, "seed {seed}: strictly nearer only");
    }
}

//! PCD files (Point Cloud Library, version 0.7): ASCII and binary.
use super::records::{Column, header, records};
use super::{no_fields, no_header, no_numbers, numbers};
use crate::mesh::Refusal;

pub(super) fn read(bytes: &[u8]) -> Result<Vec<[f64; 3]>, Refusal> {
    let (lines, rest) = header(bytes, |line| line.starts_with("DATA ")).ok_or_else(|| no_header("PCD"))?;
    let entry = |key: &str| -> Option<Vec<&str>> {
        let mut words = lines.iter().map(|line| line.split_ascii_whitespace());
        words.find_map(|mut words| (words.next() == Some(key)).then(|| words.collect()))
    };
    let one = |key: &str| entry(key).and_then(|words| words.first()?.parse::<usize>().ok());
    let names = entry("FIELDS").ok_or_else(|| no_header("PCD"))?;
    let whole =
        |key: &str| -> Option<Vec<usize>> { entry(key)?.iter().map(|word| word.parse().ok()).collect() };
    let sizes = whole("SIZE").ok_or_else(|| no_header("PCD"))?;
    let types = entry("TYPE").ok_or_else(|| no_header("PCD"))?;
    let counts = whole("COUNT").unwrap_or_else(|| vec![1; names.len()]);
    if [sizes.len(), types.len(), counts.len()] != [names.len(); 3] {
        return Err(no_header("PCD"));
    }
    let points = one("POINTS").or_else(|| one("WIDTH")?.checked_mul(one("HEIGHT")?));
    let points = points.ok_or_else(|| no_header("PCD"))?;
    let place = |name: &str| names.iter().position(|n| *n == name).ok_or_else(|| no_fields(&names.join(" ")));
    let xyz = [place("x")?, place("y")?, place("z")?];
    match entry("DATA").as_deref() {
        Some(["ascii"]) => {
            let columns = xyz.map(|field| counts[..field].iter().sum());
            let text = String::from_utf8_lossy(rest);
            let wanted = text.lines().filter(|line| !line.trim().is_empty()).take(points);
            let point = |(i, line): (usize, &str)| numbers(line, columns).ok_or_else(|| no_numbers(i, line));
            let read: Vec<[f64; 3]> = wanted.enumerate().map(point).collect::<Result<_, _>>()?;
            if read.len() < points {
                return Err((format!("has {} lines of points", read.len()), format!("{points} points")));
            }
            Ok(read)
        }
        Some(["binary"]) => {
            let bytes_of = |i: usize| sizes[i].checked_mul(counts[i]);
            let length: Option<usize> = (0..names.len()).map(bytes_of).sum();
            let length = length.filter(|l| *l > 0).ok_or_else(|| no_header("PCD"))?;
            let mut fields = [Column { offset: 0, bytes: 0 }; 3];
            for (field, i) in fields.iter_mut().zip(xyz) {
                if types[i] != "F" || ![4, 8].contains(&sizes[i]) || counts[i] != 1 {
                    return Err(no_fields(&names.join(" ")));
                }
                *field = Column { offset: (0..i).filter_map(bytes_of).sum(), bytes: sizes[i] };
            }
            records(rest, (points, length), fields, false)
        }
        _ => Err((
            "is compressed, or of a kind that is not known".to_owned(),
            "DATA ascii or DATA binary; convert it: pcl_convert_pcd_ascii_binary IN.pcd OUT.pcd 1".to_owned(),
        )),
    }
}

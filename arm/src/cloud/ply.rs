//! PLY files (Stanford polygon format 1.0): the vertices, in ASCII or binary.
use super::records::{Column, header, records};
use super::{no_fields, no_header, no_numbers, numbers};
use crate::mesh::Refusal;

pub(super) fn read(bytes: &[u8]) -> Result<Vec<[f64; 3]>, Refusal> {
    let (lines, rest) = header(bytes, |line| line == "end_header").ok_or_else(|| no_header("PLY"))?;
    if lines.first() != Some(&"ply") {
        return Err(no_header("PLY"));
    }
    let layout = Layout::of(&lines)?;
    if layout.is_ascii {
        return layout.text(rest);
    }
    let fields = layout.binary_fields()?;
    records(rest, (layout.count, layout.length()?), fields, layout.is_big_endian)
}

/// What the header says about the vertices.
struct Layout<'a> {
    is_ascii: bool,
    is_big_endian: bool,
    count: usize,
    /// Type and name of each property.
    properties: Vec<(&'a str, &'a str)>,
}

impl<'a> Layout<'a> {
    fn of(lines: &[&'a str]) -> Result<Self, Refusal> {
        let (mut format, mut count) = (None, None);
        let mut properties = Vec::new();
        // Vertices come first in every file that common programs write; others would have to be read to be skipped.
        let mut element = 0;
        for line in lines {
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words[..] {
                ["format", name, _] => format = Some(name),
                ["element", name, many] => {
                    element += 1;
                    if element == 1 {
                        if name != "vertex" {
                            let value = format!("begins with the element {name}");
                            return Err((value, "vertices as the first element".to_owned()));
                        }
                        count = many.parse().ok();
                    }
                }
                ["property", "list", ..] if element == 1 => return Err(no_fields(line)),
                ["property", kind, name] if element == 1 => properties.push((kind, name)),
                _ => {}
            }
        }
        let (is_ascii, is_big_endian) = match format {
            Some("ascii") => (true, false),
            Some("binary_little_endian") => (false, false),
            Some("binary_big_endian") => (false, true),
            _ => return Err(no_header("PLY")),
        };
        let count = count.ok_or_else(|| no_header("PLY"))?;
        Ok(Self { is_ascii, is_big_endian, count, properties })
    }

    fn column(&self, name: &str) -> Result<usize, Refusal> {
        let found = self.properties.iter().position(|(_, property)| *property == name);
        found.ok_or_else(|| no_fields(&self.names()))
    }

    fn names(&self) -> String {
        self.properties.iter().map(|(kind, name)| format!("{name}:{kind}")).collect::<Vec<_>>().join(" ")
    }

    fn text(&self, rest: &[u8]) -> Result<Vec<[f64; 3]>, Refusal> {
        let columns = [self.column("x")?, self.column("y")?, self.column("z")?];
        let text = String::from_utf8_lossy(rest);
        let lines = text.lines().filter(|line| !line.trim().is_empty()).take(self.count);
        let point = |(i, line): (usize, &str)| numbers(line, columns).ok_or_else(|| no_numbers(i, line));
        let points: Vec<[f64; 3]> = lines.enumerate().map(point).collect::<Result<_, _>>()?;
        if points.len() < self.count {
            return Err((format!("has {} lines of points", points.len()), format!("{} points", self.count)));
        }
        Ok(points)
    }

    fn length(&self) -> Result<usize, Refusal> {
        let sizes: Option<Vec<usize>> = self.properties.iter().map(|(kind, _)| size(kind)).collect();
        sizes.map(|sizes| sizes.iter().sum()).ok_or_else(|| no_fields(&self.names()))
    }

    fn binary_fields(&self) -> Result<[Column; 3], Refusal> {
        let mut fields = [Column { offset: 0, bytes: 0 }; 3];
        for (field, name) in fields.iter_mut().zip(["x", "y", "z"]) {
            let column = self.column(name)?;
            let before = self.properties[..column].iter().filter_map(|(kind, _)| size(kind)).sum();
            let bytes = match self.properties[column].0 {
                "float" | "float32" => 4,
                "double" | "float64" => 8,
                _ => return Err(no_fields(&self.names())),
            };
            *field = Column { offset: before, bytes };
        }
        Ok(fields)
    }
}

/// Bytes of a type.
fn size(kind: &str) -> Option<usize> {
    Some(match kind {
        "char" | "uchar" | "int8" | "uint8" => 1,
        "short" | "ushort" | "int16" | "uint16" => 2,
        "int" | "uint" | "int32" | "uint32" | "float" | "float32" => 4,
        "double" | "float64" => 8,
        _ => return None,
    })
}

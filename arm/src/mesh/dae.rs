//! COLLADA files (.dae): every geometry that the file's scene shows, placed by the transforms of its nodes, in metres.
//!
//! The unit of length is applied, as the format says. `up_axis` is not: rviz and `MoveIt` take such a mesh in the axes that it is
//! written in, and a link that stood turned in planning would be a wrong one. Whatever shows a solid and is not understood
//! (skins, free-form surfaces, other files) is refused.
//!
//! Source: COLLADA 1.4.1 and 1.5 specifications, Khronos Group.
use super::{Refusal, TRIANGLES_MAX, Triangles};
use crate::document::{shown, without_mark};
use crate::urdf::xml;
use nalgebra::{Matrix4, Point3, Rotation3, Unit, Vector3};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::path::Path;

/// Nodes may be shown many times over: a file of a few lines could ask for more than there is memory.
const NODES_MAX: usize = 20_000;
/// Deepest nesting of nodes that show each other.
const DEPTH_MAX: usize = 64;

pub(super) fn read(file: &Path, bytes: &[u8]) -> Result<Triangles, Refusal> {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return Err(("is not UTF-8 text".to_owned(), "a COLLADA file".to_owned()));
    };
    let text = without_mark(text);
    let document = xml::parse(file, text).map_err(|faults| match faults.0.first() {
        Some(fault) => (format!("line {}: {}", fault.line.unwrap_or(0), fault.value), fault.expected.clone()),
        None => ("is not XML".to_owned(), "a COLLADA file".to_owned()),
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err((
            format!("is an XML file of <{}>", root.tag_name().name()),
            "an element <COLLADA>".to_owned(),
        ));
    }
    let unit_m = unit_m(root)?;
    let mut walk =
        Walk { ids: ids(root), meshes: BTreeMap::new(), triangle_soup: Triangles::default(), nodes: 0 };
    let shown_scene = child(root, "scene").and_then(|scene| child(scene, "instance_visual_scene"));
    let Some(shown_scene) = shown_scene else {
        return Err(("shows no scene".to_owned(), "a <scene> with an <instance_visual_scene>".to_owned()));
    };
    let scale = Matrix4::new_scaling(unit_m);
    let scene = walk.target(shown_scene)?;
    for node in children(scene, "node") {
        walk.node(node, &scale, 0)?;
    }
    let mut triangle_soup = walk.triangle_soup;
    triangle_soup.up_axis = up_axis(root);
    if (unit_m - 1.0).abs() > 1e-12 {
        triangle_soup.remarks.push(format!("its unit is {unit_m} m"));
    }
    Ok(triangle_soup)
}

type Element<'d, 't> = Node<'d, 't>;

fn children<'d, 't>(of: Element<'d, 't>, tag: &'static str) -> impl Iterator<Item = Element<'d, 't>> {
    of.children().filter(move |node| node.is_element() && node.tag_name().name() == tag)
}

fn child<'d, 't>(of: Element<'d, 't>, tag: &'static str) -> Option<Element<'d, 't>> {
    children(of, tag).next()
}

fn refuse<T>(at: Element<'_, '_>, value: &str, expected: &str) -> Result<T, Refusal> {
    let line = at.document().text_pos_at(at.range().start).row;
    Err((format!("line {line}: <{}> {value}", at.tag_name().name()), expected.to_owned()))
}

fn ids<'d, 't>(root: Element<'d, 't>) -> BTreeMap<&'d str, Element<'d, 't>> {
    let named = root.descendants().filter(Node::is_element);
    named.filter_map(|node| Some((node.attribute("id")?, node))).collect()
}

/// Metres a unit of length; a metre where the file says nothing.
fn unit_m(root: Element<'_, '_>) -> Result<f64, Refusal> {
    let Some(unit) = child(root, "asset").and_then(|asset| child(asset, "unit")) else { return Ok(1.0) };
    let Some(meter) = unit.attribute("meter") else { return Ok(1.0) };
    match meter.trim().parse::<f64>() {
        Ok(unit_m) if (1e-6..=1e3).contains(&unit_m) => Ok(unit_m),
        _ => refuse(unit, &format!("meter = {}", shown(meter)), "metres a unit, from 1e-6 to 1000"),
    }
}

/// The axis that the file calls up, when it is not z.
fn up_axis(root: Element<'_, '_>) -> Option<String> {
    let up = child(root, "asset").and_then(|asset| child(asset, "up_axis"));
    // Y is the format's default.
    let up = up.map_or_else(|| "Y_UP".to_owned(), text_of);
    let up = up.trim();
    (up != "Z_UP").then(|| up.chars().take(16).collect())
}

/// Numbers of a text, exactly `N` of them.
fn exactly<const N: usize>(of: Element<'_, '_>) -> Result<[f64; N], Refusal> {
    let numbers = numbers::<f64>(of)?;
    let count = numbers.len();
    match <[f64; N]>::try_from(numbers) {
        Ok(exact) if exact.iter().all(|number| number.is_finite()) => Ok(exact),
        Ok(_) => refuse(of, "has a number that is not finite", "finite numbers"),
        Err(_) => refuse(of, &format!("has {count} numbers"), &format!("{N} numbers")),
    }
}

/// The whole text of an element: a comment or a processing instruction cuts it into several pieces.
fn text_of(of: Element<'_, '_>) -> String {
    of.children().filter(Node::is_text).filter_map(|piece| piece.text()).collect()
}

/// All numbers of an element's text.
fn numbers<T: std::str::FromStr>(of: Element<'_, '_>) -> Result<Vec<T>, Refusal> {
    let mut all = Vec::new();
    for word in text_of(of).split_ascii_whitespace() {
        match word.parse() {
            Ok(number) => all.push(number),
            Err(_) => return refuse(of, &format!("has {}", shown(word)), "numbers apart by blanks"),
        }
    }
    Ok(all)
}

fn attribute<'d>(of: Element<'d, '_>, name: &'static str) -> Result<&'d str, Refusal> {
    match of.attribute(name) {
        Some(value) => Ok(value),
        None => refuse(of, &format!("has no {name}"), &format!("an attribute {name}")),
    }
}

/// A number that counts or indexes.
fn index(of: Element<'_, '_>, name: &'static str, default: usize) -> Result<usize, Refusal> {
    match of.attribute(name).map(|text| text.trim().parse::<usize>()) {
        None => Ok(default),
        Some(Ok(number)) if number <= 1 << 32 => Ok(number),
        Some(_) => refuse(of, &format!("{name} = {}", shown(attribute(of, name)?)), "a whole number from 0"),
    }
}

/// The walk over the nodes of the scene.
struct Walk<'d, 't> {
    ids: BTreeMap<&'d str, Element<'d, 't>>,
    /// Meshes that were read, by their place in the file.
    meshes: BTreeMap<usize, Triangles>,
    triangle_soup: Triangles,
    nodes: usize,
}

impl<'d, 't> Walk<'d, 't> {
    /// The element that an instance shows; nothing is read from other files.
    fn target(&self, instance: Element<'d, 't>) -> Result<Element<'d, 't>, Refusal> {
        let url = attribute(instance, "url")?;
        self.named(instance, url)
    }

    fn named(&self, at: Element<'d, 't>, url: &str) -> Result<Element<'d, 't>, Refusal> {
        match url.strip_prefix('#').and_then(|id| self.ids.get(id)) {
            Some(found) => Ok(*found),
            None => refuse(at, &format!("names {}", shown(url)), "the id of an element of this file, as #ID"),
        }
    }

    fn node(&mut self, node: Element<'d, 't>, before: &Matrix4<f64>, depth: usize) -> Result<(), Refusal> {
        self.nodes += 1;
        if depth > DEPTH_MAX || self.nodes > NODES_MAX {
            let expected = format!("at most {NODES_MAX} nodes, nested at most {DEPTH_MAX} deep");
            return refuse(node, "is shown too often or too deep", &expected);
        }
        let mut here = *before;
        // Transforms come first and apply from left to right.
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "matrix" => here *= Matrix4::from_row_slice(&exactly::<16>(element)?),
                "translate" => here *= Matrix4::new_translation(&Vector3::from(exactly::<3>(element)?)),
                "scale" => here *= Matrix4::new_nonuniform_scaling(&Vector3::from(exactly::<3>(element)?)),
                "rotate" => here *= rotation(element)?,
                "skew" | "lookat" => return refuse(element, "is a transform that is not read", TRANSFORMS),
                "instance_geometry" => self.geometry(element, &here)?,
                "instance_node" => {
                    let shown = self.target(element)?;
                    self.node(shown, &here, depth + 1)?;
                }
                "node" => self.node(element, &here, depth + 1)?,
                "instance_controller" => {
                    return refuse(
                        element,
                        "shows a skin or a morph",
                        "rigid geometry, as <instance_geometry>",
                    );
                }
                // Cameras, lights, assets and what programs add about looks.
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(&mut self, instance: Element<'d, 't>, here: &Matrix4<f64>) -> Result<(), Refusal> {
        let geometry = self.target(instance)?;
        if !self.meshes.contains_key(&geometry.range().start) {
            let Some(mesh) = child(geometry, "mesh") else {
                return refuse(geometry, "has no <mesh>", "a geometry of polygons; others are not read");
            };
            let read = self.mesh(mesh)?;
            self.meshes.insert(geometry.range().start, read);
        }
        let Some(mesh) = self.meshes.get(&geometry.range().start) else { return Ok(()) };
        if self.triangle_soup.triangles.len() + mesh.triangles.len() > TRIANGLES_MAX {
            return refuse(
                instance,
                "shows too many triangles",
                &format!("at most {TRIANGLES_MAX}; simplify the mesh"),
            );
        }
        let first = self.triangle_soup.corners.len();
        let place = |corner: &[f64; 3]| here.transform_point(&Point3::from(*corner));
        self.triangle_soup.corners.extend(mesh.corners.iter().map(|corner| <[f64; 3]>::from(place(corner))));
        self.triangle_soup.triangles.extend(mesh.triangles.iter().map(|t| t.map(|corner| first + corner)));
        Ok(())
    }

    /// All polygons of a mesh, as triangles; each has its own corners.
    fn mesh(&self, mesh: Element<'d, 't>) -> Result<Triangles, Refusal> {
        let mut triangle_soup = Triangles::default();
        for part in mesh.children().filter(Node::is_element) {
            match part.tag_name().name() {
                // Lines have no inside, and vertices and sources are looked up.
                "source" | "vertices" | "extra" | "lines" | "linestrips" => {}
                "triangles" | "polylist" | "polygons" | "trifans" | "tristrips" => {
                    let (positions, offset, stride) = self.positions(part)?;
                    for polygon in polygons(part, stride)? {
                        let corners: Option<Vec<[f64; 3]>> = polygon
                            .chunks(stride)
                            .map(|corner| positions.get(*corner.get(offset)?).copied())
                            .collect();
                        let Some(corners) = corners else {
                            return refuse(
                                part,
                                "has an index beyond its positions",
                                "indices of corners that exist",
                            );
                        };
                        fan(part.tag_name().name(), &corners, &mut triangle_soup);
                    }
                }
                _ => {
                    return refuse(
                        part,
                        "is not read",
                        "triangles, polylist, polygons, trifans or tristrips",
                    );
                }
            }
            if triangle_soup.triangles.len() > TRIANGLES_MAX {
                return refuse(
                    mesh,
                    "has too many triangles",
                    &format!("at most {TRIANGLES_MAX}; simplify the mesh"),
                );
            }
        }
        Ok(triangle_soup)
    }

    /// The positions that a part's indices mean, where among its indices theirs stand, and how many indices a corner has.
    fn positions(&self, part: Element<'d, 't>) -> Result<(Vec<[f64; 3]>, usize, usize), Refusal> {
        let (mut stride, mut found) = (1, None);
        for input in children(part, "input") {
            let offset = index(input, "offset", 0)?;
            stride = stride.max(offset + 1);
            if input.attribute("semantic") == Some("VERTEX") {
                found = Some((input, offset));
            }
        }
        let Some((input, offset)) = found.filter(|_| stride <= 64) else {
            return refuse(part, "has no input VERTEX", "<input semantic=\"VERTEX\"> and at most 64 inputs");
        };
        let vertices = self.named(input, attribute(input, "source")?)?;
        let position =
            children(vertices, "input").find(|input| input.attribute("semantic") == Some("POSITION"));
        let Some(position) = position else {
            return refuse(vertices, "has no input POSITION", "<input semantic=\"POSITION\">");
        };
        let source = self.named(position, attribute(position, "source")?)?;
        Ok((self.source(source)?, offset, stride))
    }

    /// A list of points.
    fn source(&self, source: Element<'d, 't>) -> Result<Vec<[f64; 3]>, Refusal> {
        const EXPECTED: &str = "a <float_array> with an <accessor> of X, Y and Z";
        let accessor = child(source, "technique_common").and_then(|common| child(common, "accessor"));
        let Some(accessor) = accessor else { return refuse(source, "has no accessor", EXPECTED) };
        let array = self.named(accessor, attribute(accessor, "source")?)?;
        let values = numbers::<f64>(array)?;
        let (stride, first) = (index(accessor, "stride", 1)?, index(accessor, "offset", 0)?);
        let count = index(accessor, "count", 0)?;
        if stride < 3 || array.tag_name().name() != "float_array" {
            return refuse(accessor, &format!("has a stride of {stride}"), EXPECTED);
        }
        let fits = count.checked_mul(stride).is_some_and(|needed| first + needed <= values.len());
        if !fits || children(accessor, "param").take(3).any(|param| param.attribute("name").is_none()) {
            let value = format!("wants {count} points of {} numbers", values.len());
            return refuse(accessor, &value, EXPECTED);
        }
        let points = values.get(first..first + count * stride).unwrap_or_default().chunks_exact(stride);
        Ok(points.filter_map(|point| point.get(..3)?.try_into().ok()).collect())
    }
}

const TRANSFORMS: &str = "matrix, translate, rotate or scale";

fn rotation(element: Element<'_, '_>) -> Result<Matrix4<f64>, Refusal> {
    let [x, y, z, degrees] = exactly::<4>(element)?;
    match Unit::try_new(Vector3::new(x, y, z), 1e-9) {
        Some(axis) => Ok(Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()),
        None if degrees == 0.0 => Ok(Matrix4::identity()),
        None => refuse(element, "has no axis", "x y z of an axis and an angle in degrees"),
    }
}

/// The indices of each polygon of a part, all inputs of a corner one behind the other.
fn polygons(part: Element<'_, '_>, stride: usize) -> Result<Vec<Vec<usize>>, Refusal> {
    if child(part, "ph").is_some() {
        return refuse(part, "has polygons with holes", "polygons without <ph>");
    }
    let lists: Vec<Vec<usize>> = children(part, "p").map(numbers).collect::<Result<_, _>>()?;
    let mut polygons: Vec<Vec<usize>> = Vec::new();
    match part.tag_name().name() {
        "triangles" => {
            for list in &lists {
                polygons.extend(list.chunks(3 * stride).map(<[usize]>::to_vec));
            }
        }
        "polylist" => {
            let counts = child(part, "vcount").map(numbers::<usize>).transpose()?.unwrap_or_default();
            let all: Vec<usize> = lists.concat();
            let mut at = 0;
            for count in counts {
                let end = count.checked_mul(stride).and_then(|length| length.checked_add(at));
                let Some(polygon) = end.and_then(|end| all.get(at..end)) else {
                    return refuse(part, "counts more corners than it has", "a <vcount> that fits its <p>");
                };
                polygons.push(polygon.to_vec());
                at += polygon.len();
            }
            if at != all.len() {
                return refuse(part, "has more corners than it counts", "a <vcount> that fits its <p>");
            }
        }
        _ => polygons = lists,
    }
    let is_whole = |polygon: &Vec<usize>| polygon.len().is_multiple_of(stride) && polygon.len() >= 3 * stride;
    if polygons.iter().all(is_whole) {
        return Ok(polygons);
    }
    refuse(part, "has a polygon of less than three whole corners", "three or more corners each")
}

/// The triangles of one polygon, fan or strip. A fan covers at least its polygon, also a hollow one.
fn fan(kind: &str, corners: &[[f64; 3]], triangle_soup: &mut Triangles) {
    for (i, pair) in corners.windows(2).enumerate().skip(1) {
        let [a, b] = pair else { continue };
        let hub = if kind == "tristrips" { i - 1 } else { 0 };
        let Some(hub) = corners.get(hub) else { continue };
        let turned = kind == "tristrips" && i % 2 == 0;
        triangle_soup.push(if turned { [*hub, *b, *a] } else { [*hub, *a, *b] });
    }
}

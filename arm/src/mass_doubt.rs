//! Whether the masses of a robot can be the robot's: links that weigh nothing beside others that do, and arms lighter than cork.
use crate::Robot;
use crate::scene::Shape;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Arms weigh 500 to 2500 kg a cubic metre of their collision shapes; cork, 120.
const LIGHT_KG_M3: f64 = 100.0;

impl Robot {
    /// Why energies and torques by the masses that the files state are too low, for people; `None` when the masses may be
    /// right, or when nothing states one, so that nothing is computed from them.
    #[must_use]
    pub fn mass_doubt(&self) -> Option<String> {
        if self.masses.is_empty() {
            return None;
        }
        let frames = 1..=self.joints.len();
        let of = |frame: usize| {
            self.masses.iter().filter(move |m| m.frame == frame).map(|m| m.mass_kg).sum::<f64>()
        };
        let shapes = |frame: usize| self.shapes.iter().filter(move |shape| shape.frame == frame);
        let empty: Vec<&str> = frames
            .clone()
            .filter(|frame| of(*frame) <= 0.0)
            .filter_map(|frame| self.links.get(shapes(frame).next()?.link).map(String::as_str))
            .collect();
        if !empty.is_empty() {
            let all_kg: f64 = frames.map(of).sum();
            return Some(format!(
                "masses INCOMPLETE: {} move and weigh nothing ({all_kg:.3} kg in all), so energies and torques are too low; state their \
                 masses",
                empty.join(", ")
            ));
        }
        let (mass_kg, volume_m3) = frames.fold((0.0, 0.0), |(mass_kg, volume_m3), frame| {
            (
                mass_kg + of(frame),
                volume_m3 + shapes(frame).map(|shape| volume_m3_of(&shape.shape)).sum::<f64>(),
            )
        });
        (mass_kg < LIGHT_KG_M3 * volume_m3).then(|| {
            format!(
                "masses TOO SMALL: {mass_kg:.3} kg for {volume_m3:.4} m^3 of shapes that move is lighter than cork, so energies and \
                 torques are too low; correct the masses"
            )
        })
    }
}

fn volume_m3_of(shape: &Shape) -> f64 {
    match shape {
        Shape::Sphere { radius_m } => 4.0 / 3.0 * PI * radius_m.powi(3),
        Shape::Box { size_m } => size_m.iter().product(),
        Shape::Cylinder { radius_m, length_m } => PI * radius_m.powi(2) * length_m,
        Shape::Capsule { radius_m, length_m } => PI * radius_m.powi(2) * (length_m + 4.0 / 3.0 * radius_m),
        Shape::Mesh { .. } | Shape::Cloud(_) => 0.0,
        Shape::Hull { vertices_m, triangles, .. } => {
            let corner = |i: u32| {
                let vertex = usize::try_from(i).ok().and_then(|i| vertices_m.get(i));
                vertex.map_or_else(Vector3::zeros, |vertex| vertex.coords)
            };
            let cone = |[a, b, c]: [Vector3<f64>; 3]| a.dot(&b.cross(&c)) / 6.0;
            triangles.iter().map(|triangle| cone(triangle.map(corner))).sum::<f64>().abs()
        }
    }
}

//! What the tip must keep along a whole motion: the options that `plan`, `replan` and `verify` share.
use crate::angles::Position;
use clap::Args;
use std::str::FromStr;
use taustream_planner::{TipBox, TipConstraints, Upright};

/// Constraints of the tip.
#[derive(Args, Clone, Debug)]
pub(crate) struct TipArgs {
    /// Keep an axis of the tip within so many degrees of a direction along the whole motion.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = upright_deg)]
    upright_deg: Option<f64>,
    /// Axis of the tip for --upright-deg, in the tip's frame: x, y, z, -x, -y, -z, or X,Y,Z.
    #[arg(
        long,
        value_name = "AXIS",
        allow_hyphen_values = true,
        default_value = "z",
        requires = "upright_deg"
    )]
    tool_axis: Direction,
    /// Direction for --upright-deg, in the base's frame; z points up.
    #[arg(
        long,
        value_name = "AXIS",
        allow_hyphen_values = true,
        default_value = "z",
        requires = "upright_deg"
    )]
    upright_along: Direction,
    /// Keep the tip above this height (z in the base's frame), m.
    #[arg(long, value_name = "Z", allow_negative_numbers = true, value_parser = height)]
    tip_above_m: Option<f64>,
    /// Keep the tip inside this box, m: its least x, y, z, then its greatest; "-inf" and "inf" leave a side open.
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true)]
    tip_box_m: Option<BoxOfTip>,
    /// Speed limit of the tip along the whole motion, m/s. With --linear also its speed along the line, 0.25 by default.
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub(crate) tip_speed_m_s: Option<f64>,
}

impl TipArgs {
    /// The constraints of a tip, by its number.
    ///
    /// # Errors
    /// Numbers that make no sense together, with the option's name.
    pub(crate) fn of(&self, tip: usize) -> Result<TipConstraints, String> {
        let upright = self.upright_deg.map(|deg| Upright {
            tip_axis: self.tool_axis.0,
            direction: self.upright_along.0,
            tolerance_rad: deg.to_radians(),
        });
        let mut inside = self.tip_box_m.map(|BoxOfTip(inside)| inside);
        if let Some(above_m) = self.tip_above_m {
            let open = TipBox { low_m: [f64::NEG_INFINITY; 3], high_m: [f64::INFINITY; 3] };
            let low = &mut inside.get_or_insert(open).low_m[2];
            *low = low.max(above_m);
        }
        let tip = u32::try_from(tip).unwrap_or(u32::MAX);
        let asked = TipConstraints { tip, upright, inside, speed_m_s: self.tip_speed_m_s };
        match asked.fault() {
            Some((what, value)) => Err(format!("the constraint of the tip: {what} is {value}")),
            None => Ok(asked),
        }
    }

    /// True when something is asked for.
    pub(crate) fn is_given(&self) -> bool {
        self.upright_deg.is_some()
            || self.tip_above_m.is_some()
            || self.tip_box_m.is_some()
            || self.tip_speed_m_s.is_some()
    }
}

/// A direction of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Direction([f64; 3]);

impl FromStr for Direction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
        if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
            let mut direction = [0.0; 3];
            direction[axis] = sign;
            return Ok(Self(direction));
        }
        let Position(vector) = text
            .parse()
            .map_err(|_| format!("`{text}` is no axis; write x, y, z, -x, -y, -z, or three numbers"))?;
        let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(length > 1e-9 && length.is_finite()) {
            return Err(format!("`{text}` has no direction"));
        }
        Ok(Self(vector.map(|x| x / length)))
    }
}

/// A box, parallel to the base's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BoxOfTip(TipBox);

impl FromStr for BoxOfTip {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |(i, word): (usize, &str)| match word.trim().parse::<f64>() {
            Ok(value) if !value.is_nan() => Ok(value),
            Ok(_) | Err(_) => {
                Err(format!("value {} is `{}`, which is no number of metres", i + 1, word.trim()))
            }
        };
        let values: Vec<f64> = text.split(',').enumerate().map(parse).collect::<Result<_, _>>()?;
        let [x0, y0, z0, x1, y1, z1] = *values.as_slice() else {
            return Err(format!(
                "{} values; a box is six: least x, y, z, then greatest x, y, z (m)",
                values.len()
            ));
        };
        let (low_m, high_m) = ([x0, y0, z0], [x1, y1, z1]);
        for ((axis, low), high) in ['x', 'y', 'z'].into_iter().zip(low_m).zip(high_m) {
            if high <= low {
                return Err(format!("{axis} goes from {low} to {high} m; the second must be greater"));
            }
        }
        Ok(Self(TipBox { low_m, high_m }))
    }
}

fn upright_deg(text: &str) -> Result<f64, String> {
    match text.trim().trim_end_matches("deg").trim_end().parse::<f64>() {
        Ok(deg) if (0.05..=180.0).contains(&deg) => Ok(deg),
        Ok(_) | Err(_) => Err("expected 0.05 to 180 degrees".to_owned()),
    }
}

fn height(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) | Err(_) => Err("expected a finite number of metres".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_boxes_are_read_and_nonsense_is_refused() {
        assert_eq!("-z".parse(), Ok(Direction([0.0, 0.0, -1.0])));
        assert_eq!("0,3,4".parse(), Ok(Direction([0.0, 0.6, 0.8])));
        for text in ["w", "0,0,0", "1,2", "nan,0,1", "--z", ""] {
            assert!(text.parse::<Direction>().is_err(), "{text}");
        }
        let BoxOfTip(inside) = "-1,-inf,0.2,1,inf,inf".parse().unwrap();
        assert_eq!(inside.low_m[2].to_bits(), 0.2_f64.to_bits());
        for text in ["0,0,0,1,1", "0,0,0,0,1,1", "0,0,0,nan,1,1", "0,0,0,1,1,-1"] {
            assert!(text.parse::<BoxOfTip>().is_err(), "{text}");
        }
        assert!(upright_deg("0").is_err() && upright_deg("181").is_err() && upright_deg("x").is_err());
        assert_eq!(upright_deg("10deg"), Ok(10.0));
    }
}

//! Which profiles a list of way points may be moved through with, by name.
use taustream_motion::profile::{KError, Profile, Quintic, Septic, TauJ, TauJStar};
use taustream_motion::stroke::{N_MAX, N_MIN};

/// k where none is given: the papers'.
pub const K_DEFAULT: f64 = 0.1;

/// A profile through way points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ViaProfile {
    /// Tau-J, at rest at every point; sets out with a jerk.
    TauJ {
        /// Its k.
        k: f64,
    },
    /// Tau-J*, at rest at every point. With 1/k a whole number from 4 to 64 it is a stroke as it stands.
    TauJStar {
        /// Its k.
        k: f64,
    },
    /// Quintic polynomials, at rest at every point.
    Quintic,
    /// Polynomials of degree seven, at rest at every point.
    Septic,
    /// A clamped cubic spline: passes the points, at rest at the ends.
    CubicSpline,
    /// A not-a-knot cubic spline: passes the points, not at rest anywhere.
    NotAKnot,
    /// A B-spline of degree seven: passes the points, velocity, acceleration and jerk zero at the ends.
    BSpline7,
}

/// Why there is no such profile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// A name that is not in use.
    #[error("there is no profile named \"{name}\"; there are {}", ViaProfile::NAMES.join(", "))]
    Unknown {
        /// The name that was requested.
        name: String,
    },
    /// A k that is refused.
    #[error(transparent)]
    K(#[from] KError),
    /// A k for a profile without one.
    #[error("profile {name} has no k; only tau-j and tau-j-star have")]
    NoK {
        /// The profile.
        name: &'static str,
    },
}

impl ViaProfile {
    /// The words that users write.
    pub const NAMES: [&'static str; 7] =
        ["tau-j", "tau-j-star", "quintic", "septic", "cubic-spline", "not-a-knot", "b-spline7"];

    /// The profile of a name; `k` is for the tau profiles alone.
    ///
    /// # Errors
    /// An unknown name, a k out of range, a k where there is none.
    pub fn from_name(name: &str, k: Option<f64>) -> Result<Self, ProfileError> {
        let k_or_default = k.unwrap_or(K_DEFAULT);
        let profile = match name {
            "tau-j" => Self::TauJ { k: k_or_default },
            "tau-j-star" => Self::TauJStar { k: k_or_default },
            "quintic" => Self::Quintic,
            "septic" => Self::Septic,
            "cubic-spline" => Self::CubicSpline,
            "not-a-knot" => Self::NotAKnot,
            "b-spline7" => Self::BSpline7,
            _ => return Err(ProfileError::Unknown { name: name.chars().take(64).collect() }),
        };
        let has_k = matches!(profile, Self::TauJ { .. } | Self::TauJStar { .. });
        if has_k {
            TauJ::new(k_or_default)?;
        } else if k.is_some() {
            return Err(ProfileError::NoK { name: profile.name() });
        }
        Ok(profile)
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        let [tau_j, tau_j_star, quintic, septic, cubic, not_a_knot, seventh] = Self::NAMES;
        match self {
            Self::TauJ { .. } => tau_j,
            Self::TauJStar { .. } => tau_j_star,
            Self::Quintic => quintic,
            Self::Septic => septic,
            Self::CubicSpline => cubic,
            Self::NotAKnot => not_a_knot,
            Self::BSpline7 => seventh,
        }
    }

    /// The exponent of the strokes that this profile is, exactly; `None` for one that only strokes together can come near.
    #[must_use]
    pub fn stroke_n(self) -> Option<u32> {
        let Self::TauJStar { k } = self else { return None };
        // 1/k of a k such as 0.05, which binary numbers do not hold, is a whole number after rounding.
        (N_MIN..=N_MAX).find(|n| (f64::from(*n) * k - 1.0).abs() < 1e-12)
    }

    /// The scalar profile of one that rests at every point.
    pub(super) fn scalar(self) -> Result<Option<Box<dyn Profile>>, KError> {
        Ok(match self {
            Self::TauJ { k } => Some(Box::new(TauJ::new(k)?)),
            Self::TauJStar { k } => Some(Box::new(TauJStar::new(k)?)),
            Self::Quintic => Some(Box::new(Quintic)),
            Self::Septic => Some(Box::new(Septic)),
            Self::CubicSpline | Self::NotAKnot | Self::BSpline7 => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_of_every_name_is_found_and_others_are_refused() {
        for name in ViaProfile::NAMES {
            assert_eq!(ViaProfile::from_name(name, None).map(ViaProfile::name), Ok(name));
        }
        let said = ViaProfile::from_name("cubic", None).unwrap_err().to_string();
        assert!(said.contains("\"cubic\"") && said.contains("not-a-knot"), "{said}");
        assert!(ViaProfile::from_name("tau-j", Some(0.4)).is_err_and(|e| e.to_string().contains("0.4")));
        assert!(ViaProfile::from_name("septic", Some(0.1)).is_err_and(|e| e.to_string().contains("no k")));
    }

    #[test]
    fn tau_j_star_of_a_whole_number_is_a_stroke() {
        for n in N_MIN..=N_MAX {
            assert_eq!(ViaProfile::TauJStar { k: 1.0 / f64::from(n) }.stroke_n(), Some(n));
        }
        for k in [0.05, 0.1, 0.2, 0.25] {
            assert!(ViaProfile::TauJStar { k }.stroke_n().is_some(), "{k}");
        }
        for k in [0.3, 1.0 / 3.5, 1.0 / 65.0, 0.15, 0.142_857_1] {
            assert_eq!(ViaProfile::TauJStar { k }.stroke_n(), None, "{k}");
        }
        assert_eq!(ViaProfile::TauJ { k: 0.1 }.stroke_n(), None);
    }
}

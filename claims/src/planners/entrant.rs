//! Who takes part: a planner by name, and for the default, how it improves what it found.
use taustream_optimizers::METHODS;
use taustream_planner::{Improvement, PlannerKind};

/// Who takes part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entrant {
    /// The word that names it.
    pub name: String,
    /// The planner.
    pub planner: PlannerKind,
    /// How the default planner improves what it found; the others do not look at it.
    pub improvement: Improvement,
}

impl Entrant {
    /// Reads a planner's name, or `auto+` and an improvement: `none`, `searches` or a method.
    ///
    /// # Errors
    /// Lists what there is.
    pub fn from_name(name: &str) -> Result<Self, String> {
        let (planner, improvement) = match name.split_once('+') {
            Some(("auto", word)) => (Some(PlannerKind::Auto), Improvement::from_name(word)),
            Some(_) => (None, None),
            None => (PlannerKind::from_name(name), Some(Improvement::default())),
        };
        match (planner, improvement) {
            (Some(planner), Some(improvement)) => Ok(Self { name: name.to_owned(), planner, improvement }),
            _ => Err(format!(
                "there is no planner \"{name}\"; there are {}, and auto+none, auto+searches or auto+METHOD",
                PlannerKind::names()
            )),
        }
    }

    /// Every planner by name, the default first.
    #[must_use]
    pub fn all() -> Vec<Self> {
        PlannerKind::all().map(|kind| Self::plain(kind.name(), kind, Improvement::default())).collect()
    }

    /// The default planner with every improvement, the default one first.
    #[must_use]
    pub fn improvements() -> Vec<Self> {
        let auto = |name: &str, improvement| Self::plain(name, PlannerKind::Auto, improvement);
        let own = [
            auto("auto", Improvement::default()),
            auto("auto+none", Improvement::Nothing),
            auto("auto+searches", Improvement::Searches),
        ];
        let methods = METHODS.iter().map(|m| auto(&format!("auto+{}", m.name), Improvement::Method(m)));
        own.into_iter().chain(methods).collect()
    }

    fn plain(name: &str, planner: PlannerKind, improvement: Improvement) -> Self {
        Self { name: name.to_owned(), planner, improvement }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_listed() {
        for entrant in Entrant::all().into_iter().chain(Entrant::improvements()) {
            assert_eq!(Entrant::from_name(&entrant.name), Ok(entrant));
        }
        for name in ["", "auto+", "auto+teleport", "rbf+de", "teleport", "+de"] {
            let words = Entrant::from_name(name).unwrap_err();
            assert!(words.contains("auto+METHOD") && words.contains("rbf"), "{words}");
        }
    }
}

//! Worlds that follow a changing scene: what has not changed is not built again.
use super::{Other, RobotOf, StillBody, World};
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use taustream_arm::body::to_parry;
use taustream_arm::{Robot, Scene, Zone};

impl World<'static> {
    /// The same as [`World::new`], for a robot that is shared.
    ///
    /// # Errors
    /// The name of the link or obstacle whose shape cannot be built.
    pub fn shared(robot: Arc<Robot>, scene: &Scene) -> Result<Self, String> {
        Self::of(RobotOf::Shared(robot), scene)
    }
}

impl World<'_> {
    /// The same arm in another scene. Obstacles of a name that this world has keep their shape and get their pose, unless they
    /// are listed in `reshaped`.
    ///
    /// # Errors
    /// The name of the obstacle whose shape cannot be built.
    pub fn in_scene(&self, scene: &Scene, reshaped: &BTreeSet<String>) -> Result<Self, String> {
        let known: HashMap<&str, &StillBody> =
            self.obstacles.iter().map(|still| (still.name.as_str(), still)).collect();
        let mut obstacles = Vec::with_capacity(scene.obstacles.len());
        for obstacle in &scene.obstacles {
            let known = known.get(obstacle.name.as_str()).filter(|_| !reshaped.contains(&obstacle.name));
            obstacles.push(match known {
                Some(still) => {
                    let at = still.body.placed(&to_parry(&obstacle.pose));
                    StillBody { at, ..(*still).clone() }
                }
                None => StillBody::new(obstacle)?,
            });
        }
        let mut world = Self { obstacles, margin_m: scene.margin_m, pairs: Vec::new(), ..self.clone() };
        world.pairs = world.pairs_to_keep(scene.margin_m);
        Ok(world)
    }

    /// Where tips have speed limits.
    #[must_use]
    pub fn zones(&self) -> &[Zone] {
        &self.zones
    }

    /// The same world, of which only the pairs with these obstacles, and those of these links, count.
    #[must_use]
    pub fn only(&self, obstacles: &BTreeSet<String>, links: &BTreeSet<String>) -> Self {
        let of_links: Vec<bool> = self
            .links
            .iter()
            .map(|body| self.robot.links.get(body.link).is_some_and(|name| links.contains(name)))
            .collect();
        let counts = |link: usize| of_links.get(link).copied().unwrap_or(false);
        let mut world = self.clone();
        world.pairs.retain(|pair| {
            counts(pair.link)
                || match pair.other {
                    Other::Obstacle(o) => {
                        self.obstacles.get(o).is_some_and(|still| obstacles.contains(&still.name))
                    }
                    Other::Link(link) => counts(link),
                }
        });
        world
    }
}

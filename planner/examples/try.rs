use std::time::{Duration, Instant};
use taustream_planner::*;
fn main() {
    let d = std::env::args().nth(1).unwrap_or("pillars".into());
    let robot = taustream_arm::Robot::load("config/robots/ur5.toml".as_ref()).unwrap();
    let scene = taustream_arm::Scene::load(format!("config/scenes/{d}.toml").as_ref()).unwrap();
    let world = world::World::new(&robot, &scene).unwrap();
    println!("pairs {} reach {:?}", world.pairs().len(), world.reach_m());
    let mut free = Vec::new();
    let mut draw = draw::Draw::new(1, 0);
    let mut s = world::Snapshot::default();
    let t = Instant::now();
    let mut n = 0;
    let w = work::Work::unbounded();
    let space = tree::Space::new(&world, &w);
    while free.len() < 40 {
        let q = space.draw_pose(&mut draw);
        n += 1;
        if world.is_free(&q, 0.001, &mut s) {
            free.push(q);
        }
    }
    println!("{n} samples, {:?} each", t.elapsed() / n);
    let ms: u64 = std::env::args().nth(2).map_or(2000, |x| x.parse().unwrap());
    for p in free.chunks(2) {
        for k in PlannerKind::ALL {
            let t = Instant::now();
            let r = plan(
                &robot,
                &scene,
                &p[0],
                &p[1],
                &PlanOptions { seed: 1, deadline: Duration::from_millis(ms), planner: k },
            );
            match r {
                Ok(r) => println!(
                    "{:>11} ok {:.0?} T={:.3} clr={:.4} n={} {}",
                    k.name(),
                    t.elapsed(),
                    r.proof.duration_s,
                    r.proof.clearance_m,
                    r.trajectory.strokes().len(),
                    r.how
                ),
                Err(e) => println!("{:>11} ERR {:.0?} {e}", k.name(), t.elapsed()),
            }
        }
    }
}

//! A program that tracks an object: it adds a ball to the running planner's scene and moves it to and fro, 30 times a second.
//!
//! ```sh
//! cargo run -p taustream-planner --example move_obstacle -- vcan6
//! ```
//!
//! Each change is one message of fixed size in shared memory, and has an answer: what it means for the motion that runs. When
//! this program dies the ball stays where it was seen last.
use anyhow::{Context, Result, anyhow};
use std::time::{Duration, Instant};
use std::{env, thread};
use taustream_arm::runtime;
use taustream_messages::event::Topic;
use taustream_messages::scene::{FixedTo, ObjectPose, ObjectShape, SceneChange};
use taustream_messages::scene_reply::SceneOutcome;
use taustream_messages::service::Wire;
use taustream_messages::{CheckedSceneRequest, SceneRequest};

const RATE_HZ: f64 = 30.0;
const DURATION: Duration = Duration::from_secs(10);

fn main() -> Result<()> {
    let arm = env::args().nth(1).context("usage: move_obstacle ARM")?;
    let wire = Wire::join(&arm, "move-obstacle", &runtime::directory()?)?;
    let (scene, events) = (wire.scene_client()?, wire.events(Topic::Plan));
    let begun = Instant::now();
    // A client may have two requests on their way: the older answer is given up.
    let mut waiting = Vec::new();
    while begun.elapsed() < DURATION {
        let aside_m = 0.2 * (begun.elapsed().as_secs_f64() * std::f64::consts::PI).sin();
        let ball = SceneChange::Add {
            name: "tracked".to_owned(),
            shape: ObjectShape::Sphere { radius_m: 0.05 },
            pose: ObjectPose { position_m: [0.7, aside_m, 0.4], quaternion_xyzw: [0.0, 0.0, 0.0, 1.0] },
            fixed_to: FixedTo::Base,
            mass_kg: 0.0,
            // Whether it is there already or not.
            replaces: true,
        };
        if waiting.len() > 1 {
            waiting.remove(0);
        }
        let pending = scene.send_copy(SceneRequest::from(&CheckedSceneRequest::Change(vec![ball])))?;
        if pending.number_of_server_connections() == 0 {
            return Err(anyhow!("no planner serves arm `{arm}`"));
        }
        // It looks at once.
        events.notify();
        waiting.push(pending);

        let mut unanswered = Vec::new();
        for pending in waiting {
            match pending.receive()?.map(|reply| reply.payload().outcome()) {
                Some(SceneOutcome::Changed { effect, note, .. }) if !note.is_empty() => {
                    eprintln!("{}: {note}", effect.word());
                }
                Some(SceneOutcome::Refused { reason }) => eprintln!("refused: {reason}"),
                Some(SceneOutcome::Changed { .. } | SceneOutcome::Listed { .. }) => {}
                None => unanswered.push(pending),
            }
        }
        waiting = unanswered;
        thread::sleep(Duration::from_secs_f64(1.0 / RATE_HZ));
    }
    Ok(())
}

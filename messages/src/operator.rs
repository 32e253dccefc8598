//! What the command line and the streamer say to each other where shared memory is out of reach.
//!
//! One line each way over a stream socket. It can be written by hand: `echo stop | socat - UNIX:/run/taustream/NAME.stop`.
use crate::{Command, CommandReply, Phase};
use std::path::{Path, PathBuf};

/// Longest request, bytes.
pub const LINE_BYTES_MAX: usize = 64;
/// Asks for the phase only.
pub const PHASE: &str = "phase";
/// The commands that are taken: they take motion away and never add any.
pub const COMMANDS: [(&str, Command); 3] =
    [("stop", Command::Stop), ("stop --fast", Command::FastStop), ("torque-off", Command::TorqueOff)];

/// The socket in the runtime directory.
#[must_use]
pub fn socket_file(arm: &str, runtime: &Path) -> PathBuf {
    runtime.join(format!("{arm}.stop"))
}

/// The abstract name of the same socket, which is in no directory.
#[must_use]
pub fn abstract_name(arm: &str, uid: u32) -> String {
    format!("taustream/{uid}/{arm}/stop")
}

/// The command of a request.
#[must_use]
pub fn command_of(line: &str) -> Option<Command> {
    COMMANDS.iter().find(|(word, _)| *word == line).map(|(_, command)| *command)
}

/// The request of a command, if it is one that is taken.
#[must_use]
pub fn request_of(command: Command) -> Option<&'static str> {
    COMMANDS.iter().find(|(_, taken)| *taken == command).map(|(word, _)| *word)
}

/// The answer to a request.
#[must_use]
pub fn answer_line(accepted: bool, phase: Phase, text: &str) -> String {
    let what = if accepted { "accepted" } else { "refused" };
    let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("{what}\t{}\t{text}\n", phase.word())
}

/// Reads an answer; `None` for what is none.
#[must_use]
pub fn read_answer(line: &str) -> Option<CommandReply> {
    let mut words = line.trim_end_matches('\n').splitn(3, '\t');
    let (what, phase, text) = (words.next()?, words.next()?, words.next()?);
    let phase = Phase::ALL.into_iter().find(|known| known.word() == phase)?;
    match what {
        "accepted" => Some(CommandReply::accepted(phase, text)),
        "refused" => Some(CommandReply::refused(phase, text)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answer_read_back_is_what_was_written() {
        for phase in Phase::ALL {
            for accepted in [true, false] {
                let reply = read_answer(&answer_line(accepted, phase, "slowing\ndown; `resume`")).unwrap();
                assert_eq!((reply.is_accepted(), reply.phase()), (accepted, Some(phase)));
                assert_eq!(reply.text(), "slowing down; `resume`");
            }
        }
        for hostile in ["", "accepted", "accepted\tholding", "yes\tholding\t", "accepted\tflying\t"] {
            assert_eq!(read_answer(hostile), None, "{hostile:?}");
        }
    }

    #[test]
    fn request_of_a_command_that_adds_motion_is_none() {
        for (word, command) in COMMANDS {
            assert_eq!((command_of(word), request_of(command)), (Some(command), Some(word)));
        }
        for command in
            [Command::Enable, Command::Resume, Command::Speed { percent: 100.0 }, Command::ClearFault]
        {
            assert_eq!(request_of(command), None, "{command:?}");
        }
        for hostile in ["STOP", "stop;enable", "enable", ""] {
            assert_eq!(command_of(hostile), None, "{hostile}");
        }
    }
}

//! The arguments of `taustream-servosim`, in the library because the manual page is made from them.
use crate::link::LinkChoice;
use clap::Parser;

/// What the manual says beyond the list of options.
const MANUAL: &str = "\
Each servo of the settings file becomes one CiA 402 drive (CANopen, cyclic synchronous position) with its own object
dictionary, motor, gravity load and watchdog. The optional [simulator] section of the file sets dynamics and watchdog.

A fault is  joint=NAME|NUMBER,kind=KIND[,value=V][,after=start|enable|moving][,at_s=T][,for_s=T]
  silence   the drive neither sends nor receives         delay    its frames come V ms late (5)
  drop      each frame is lost with probability V        fault    it reports EMCY code V (0x2310)
  stuck     the joint is jammed                          jump     its encoder reads V rad too much (0.2)
  warning   it sets the warning bit                      refuse   it refuses SDO writes with abort code V
  restart   its supply dips and it reboots
Lines on the standard input do the same while it runs:  fault SPEC | clear | clear joint=NAME | status

An object is  joint=NAME|NUMBER,object=0xINDEX:SUB,value=NUMBER|absent  (all joints without joint=). A drive whose gear ratio
(0x6091), feed constant (0x6092), position factor (0x6093), home offset (0x607C) or polarity (0x607E) is changed counts as it says.
[simulator] takes the same texts as a list: objects.

Examples:
  taustream-servosim --settings vcan6 --start-rad \"0,-1.57,1.57,-1.57,-1.57,0\"
  taustream-servosim --settings vcan6 --link local --fault joint=elbow,kind=silence,after=moving,at_s=0.5

It does not model a safety function: real arms need their own emergency stop.

Exit status: 0 ended by SIGINT or SIGTERM, 1 the link failed, 2 bad usage or bad file.";

/// Simulate the servos of a settings file on its buses: motion, gravity, warnings and faults of real servos.
#[derive(Debug, Parser)]
#[command(name = "taustream-servosim", version, after_help = MANUAL)]
pub struct Arguments {
    /// Settings file, or the name of one in the configuration directories.
    #[arg(long, value_name = "FILE")]
    pub settings: String,
    /// CAN link.
    #[arg(long, value_enum, default_value_t)]
    pub link: LinkChoice,
    /// Joint angles at power-up, base to tip: "q1,q2,..".
    #[arg(long, value_name = "Q1,Q2,..", allow_hyphen_values = true)]
    pub start_rad: Option<String>,
    /// Inject a fault; may be repeated (see below).
    #[arg(long = "fault", value_name = "SPEC")]
    pub faults: Vec<String>,
    /// Another value of an object of a CiA 402 drive: "joint=3,object=0x6091:01,value=50"; may be given several times.
    #[arg(long = "object", value_name = "SPEC")]
    pub objects: Vec<String>,
    /// Seed of the lost frames.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

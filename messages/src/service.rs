//! Names, sizes and the explicit iceoryx2 configuration of every service.
//!
//! Segments lie in one flat name space of the host, so the arm's name and the user's id stand in the prefix:
//! two arms, or two users, on one host do not meet. Nothing is read from an iceoryx2 file, and segments belong
//! to one uid only.
use crate::cloud::CloudRequest;
use crate::files::{ArmFiles, Footprint, NODE_COUNTER, ROOT, SEGMENTS, UsersLock};
use crate::operator::abstract_name;
use crate::{
    CommandReply, CommandRequest, PlanReply, PlanRequest, Receipt, Report, SceneReply, SceneRequest,
    TargetReply, TargetRequest, TrajectoryMessage,
};
use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::{client::Client, publisher::Publisher, server::Server, subscriber::Subscriber};
use iceoryx2::prelude::{
    FileName, LogLevel, Path as IceoryxPath, SemanticString, SignalHandlingMode, ipc,
    set_log_level_from_env_or,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use rustix::net::sockopt::socket_peercred;
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
use std::cell::OnceCell;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Sends trajectories.
pub type TrajectoryPublisher = Publisher<ipc::Service, TrajectoryMessage, ()>;
/// Receives trajectories.
pub type TrajectorySubscriber = Subscriber<ipc::Service, TrajectoryMessage, ()>;
/// Sends receipts.
pub type ReceiptPublisher = Publisher<ipc::Service, Receipt, ()>;
/// Receives receipts.
pub type ReceiptSubscriber = Subscriber<ipc::Service, Receipt, ()>;
/// Sends reports.
pub type ReportPublisher = Publisher<ipc::Service, Report, ()>;
/// Receives reports.
pub type ReportSubscriber = Subscriber<ipc::Service, Report, ()>;
/// Asks the streamer.
pub type CommandClient = Client<ipc::Service, CommandRequest, (), CommandReply, ()>;
/// Answers commands.
pub type CommandServer = Server<ipc::Service, CommandRequest, (), CommandReply, ()>;
/// Asks the planner.
pub type PlanClient = Client<ipc::Service, PlanRequest, (), PlanReply, ()>;
/// Changes the planner's scene.
pub type SceneClient = Client<ipc::Service, SceneRequest, (), SceneReply, ()>;
/// Takes changes of the scene.
pub type SceneServer = Server<ipc::Service, SceneRequest, (), SceneReply, ()>;
/// Sends point clouds to the planner's scene.
pub type CloudClient = Client<ipc::Service, CloudRequest, (), SceneReply, ()>;
/// Takes point clouds.
pub type CloudServer = Server<ipc::Service, CloudRequest, (), SceneReply, ()>;
/// Sends targets to the planner.
pub type TargetClient = Client<ipc::Service, TargetRequest, (), TargetReply, ()>;
/// Takes targets.
pub type TargetServer = Server<ipc::Service, TargetRequest, (), TargetReply, ()>;
/// Answers replan requests.
pub type PlanServer = Server<ipc::Service, PlanRequest, (), PlanReply, ()>;

/// Most processes that may use one service: planner, streamer and command lines.
pub(crate) const NODES_MAX: usize = 32;
/// Most subscribers of reports and receipts.
const SUBSCRIBERS_MAX: usize = 24;
/// Most processes that may send trajectories at one time.
const PUBLISHERS_MAX: usize = 4;
/// The streamer, the planner and those of three neighbours, and some that have died and are not cleared away yet.
const TRAJECTORY_READERS_MAX: usize = 8;
/// Reports that a slow reader may lag behind; older ones are overwritten.
const REPORT_BUFFER: usize = 64;
/// Receipts that a slow reader may lag behind.
const RECEIPT_BUFFER: usize = 64;
/// Trajectories that wait for the streamer's intake.
const TRAJECTORY_BUFFER: usize = 8;
/// Most clients of a request-response service.
const CLIENTS_MAX: usize = 24;
/// How long a service that another process creates may take.
const CREATION_WITHIN: Duration = Duration::from_millis(400);
/// Longest path that iceoryx2 can make; a longer one would be a panic in the middle of it.
const PATH_BYTES_MAX: usize = 255;
/// Below the root stand `/nodes/`, up to 39 digits, `/`, the prefix, 40 digits and at most `.service_tag`.
const NAME_BELOW_ROOT_BYTES: usize = 7 + 39 + 1 + 40 + 12;
/// Longest arm name.
const NAME_MAX: usize = 32;

/// Why services cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ServiceError {
    /// The arm's name does not fit into a file name.
    #[error("arm name `{name}`: use 1 to {NAME_MAX} letters, digits, '-' or '_'")]
    Name {
        /// The name that was given.
        name: String,
    },
    /// No process serves this arm.
    #[error("{who} of arm `{arm}` is not running for this user (uid {uid}){others}; start {who} first")]
    NotRunning {
        /// `taustream-streamer` or `taustream-planner`.
        who: &'static str,
        /// The arm's name.
        arm: String,
        /// Our user.
        uid: u32,
        /// Other users who serve it, as a clause; empty if none.
        others: String,
    },
    /// The streamer runs, and cannot be found in shared memory.
    #[error(
        "taustream-streamer of arm `{arm}` runs (process {pid}), but does not answer in shared memory: its names may be gone (RemoveIPC=yes at \
         logout, a cleaner of /tmp, rm -rf), then it opens them again within a second or two, or it hangs; try again; `stop`, \
         `stop --fast` and `torque-off` use its own socket meanwhile"
    )]
    NamesGone {
        /// The arm's name.
        arm: String,
        /// The streamer's process.
        pid: i32,
    },
    /// Another process serves this arm in the same role.
    #[error("arm `{arm}` has a taustream-{who} already{}; end that one first", pid.map(|pid| format!(" (process {pid})")).unwrap_or_default())]
    Served {
        /// The arm's name.
        arm: String,
        /// `streamer` or `planner`.
        who: &'static str,
        /// Its process, as far as known.
        pid: Option<u32>,
    },
    /// Another user has taken a name of this arm.
    #[error(
        "shared memory of arm `{arm}`: {} belongs to uid {owner}, not to uid {uid}: another user has taken the name; \
         remove it as that user or as root: rm {}", path.display(), path.display()
    )]
    Foreign {
        /// The arm's name.
        arm: String,
        /// The file.
        path: PathBuf,
        /// Its owner.
        owner: u32,
        /// Our user.
        uid: u32,
    },
    /// Something that is no segment stands in the place of one.
    #[error("shared memory of arm `{arm}`: {} is {kind}, where a segment belongs; remove it: rm {}", path.display(), path.display())]
    Blocked {
        /// The arm's name.
        arm: String,
        /// The file.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
    },
    /// iceoryx2 refused.
    #[error("shared memory of arm `{arm}`: cannot {what}: {why}")]
    Refused {
        /// The arm's name.
        arm: String,
        /// What was tried.
        what: &'static str,
        /// iceoryx2's reason.
        why: String,
    },
}

/// A service that a process opens once: iceoryx2 0.10 ends a process that opens a service again when somebody has deleted its files
/// in between, because it finds its first share in it where the new one belongs.
type Opened<P> = OnceCell<PortFactory<ipc::Service, P, ()>>;

/// One process's access to the services of one arm of one user.
#[derive(Debug)]
pub struct Wire {
    arm: String,
    uid: u32,
    // Before the node, which they are parts of.
    trajectory: Opened<TrajectoryMessage>,
    receipt: Opened<Receipt>,
    report: Opened<Report>,
    node: Node<ipc::Service>,
    files: ArmFiles,
    // After the node: its files go first.
    _users: UsersLock,
}

/// True for a name that may stand in a file name.
#[must_use]
pub fn is_arm_name(name: &str) -> bool {
    (1..=NAME_MAX).contains(&name.len())
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_')
}

pub(crate) fn prefix(arm: &str, uid: u32) -> String {
    format!("taustream.{uid}.{arm}.")
}

/// The uids that have segments of an arm of this name, in rising order.
#[must_use]
pub fn users_of(arm: &str) -> Vec<u32> {
    let suffix = format!(".{arm}.");
    let entries = fs::read_dir(SEGMENTS).into_iter().flatten().flatten();
    let mut uids: Vec<u32> = entries
        .filter_map(|e| {
            let name = e.file_name();
            let rest =
                name.to_str()?.strip_prefix("taustream.").filter(|name| !name.ends_with(NODE_COUNTER))?;
            let (uid, rest) = rest.split_at(rest.find('.')?);
            rest.starts_with(&suffix).then(|| uid.parse().ok())?
        })
        .collect();
    uids.sort_unstable();
    uids.dedup();
    uids
}

/// iceoryx2 makes the node counter writable for everybody, whatever the umask. A stranger who cuts it short would end every
/// process that starts later, so it is taken back at once.
fn close_node_counter(prefix: &str) {
    for entry in fs::read_dir(SEGMENTS).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if name.to_str().is_some_and(|name| name.starts_with(prefix) && name.ends_with(NODE_COUNTER)) {
            // A failure is no reason not to serve: the file may be gone again.
            let _as_it_is = fs::set_permissions(entry.path(), fs::Permissions::from_mode(0o600));
        }
    }
}

/// The streamer's program.
const STREAMER: &str = "taustream-streamer";

/// The process behind the abstract name of a streamer's own socket, if it is of this user.
fn streamer_of(arm: &str, uid: u32) -> Option<i32> {
    let socket = socket_with(
        AddressFamily::UNIX,
        SocketType::STREAM,
        SocketFlags::NONBLOCK | SocketFlags::CLOEXEC,
        None,
    )
    .ok()?;
    let address = SocketAddrUnix::new_abstract_name(abstract_name(arm, uid).as_bytes()).ok()?;
    // Non-blocking: a full queue is an answer too, but says nothing about who serves.
    connect(&socket, &address).ok()?;
    let peer = socket_peercred(&socket).ok()?;
    (peer.uid.as_raw() == uid).then(|| peer.pid.as_raw_nonzero().get())
}

impl Wire {
    /// Joins the services of `arm` (the settings' name) as this user, under `node_name`. `runtime` is the runtime
    /// directory of all processes of the arm, which must exist and belong to this user.
    ///
    /// # Errors
    /// When the name is unfit, or shared memory is not to be had.
    pub fn join(arm: &str, node_name: &str, runtime: &Path) -> Result<Self, ServiceError> {
        if !is_arm_name(arm) {
            return Err(ServiceError::Name { name: arm.to_owned() });
        }
        // iceoryx2 writes its own lines to stderr, where `--json` promises JSON; whatever matters comes back as an error.
        // IOX2_LOG_LEVEL brings them back for whoever looks for a fault in it.
        set_log_level_from_env_or(LogLevel::Fatal);
        let uid = rustix::process::geteuid().as_raw();
        let files = ArmFiles::of(arm, runtime);
        files.check_owner()?;
        let users = files.lock_shared()?;
        let refused = |why: String| ServiceError::Refused { arm: arm.to_owned(), what: "join", why };
        let config = config(arm, uid, runtime).map_err(refused)?;
        let name = node_name.try_into().map_err(|e| refused(format!("{e:?}")))?;
        let node = NodeBuilder::new()
            .name(&name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|e| refused(format!("{e:?}")))?;
        close_node_counter(&prefix(arm, uid));
        Ok(Self {
            arm: arm.to_owned(),
            uid,
            trajectory: OnceCell::new(),
            receipt: OnceCell::new(),
            report: OnceCell::new(),
            node,
            files,
            _users: users,
        })
    }

    /// The files that this process's services stand on now; take it when every port is open.
    #[must_use]
    pub fn footprint(&self) -> Footprint {
        Footprint::of(&self.files, &self.node.id().value().to_string())
    }

    pub(crate) fn node(&self) -> &Node<ipc::Service> {
        &self.node
    }

    /// The arm's name.
    #[must_use]
    pub fn arm(&self) -> &str {
        &self.arm
    }

    /// That no process serves this arm, naming other users who do.
    #[must_use]
    pub fn not_running(&self, who: &'static str) -> ServiceError {
        if who == STREAMER
            && let Some(pid) = streamer_of(&self.arm, self.uid)
        {
            return ServiceError::NamesGone { arm: self.arm.clone(), pid };
        }
        let uids = users_of(&self.arm).into_iter().filter(|uid| *uid != self.uid);
        let list: Vec<String> = uids.map(|uid| uid.to_string()).collect();
        let others = if list.is_empty() {
            String::new()
        } else {
            format!(", but uid {} runs one: use that user's account", list.join(", "))
        };
        ServiceError::NotRunning { who, arm: self.arm.clone(), uid: self.uid, others }
    }

    fn refused(&self, what: &'static str, why: &dyn std::fmt::Debug) -> ServiceError {
        let mut why = format!("{why:?}");
        // The one refusal that users cause, and can fix.
        if why.contains("ExceedsMaxSupportedSubscribers") {
            why = format!(
                "all {SUBSCRIBERS_MAX} places for readers are taken; end one, such as a `taustream watch`"
            );
        }
        ServiceError::Refused { arm: self.arm.clone(), what, why }
    }
}

fn config(arm: &str, uid: u32, root: &Path) -> Result<Config, String> {
    let mut config = Config::default();
    let prefix = FileName::new(prefix(arm, uid).as_bytes()).map_err(|e| format!("prefix: {e:?}"))?;
    let root = root.join(ROOT);
    let root = root.to_str().ok_or("the runtime directory is not UTF-8")?;
    let longest = root.len() + NAME_BELOW_ROOT_BYTES + prefix.len();
    if longest > PATH_BYTES_MAX {
        return Err(format!(
            "{root}: with the names below it its paths have {longest} bytes, at most {PATH_BYTES_MAX} are possible; set \
             TAUSTREAM_RUNTIME_DIR to a directory with a shorter path"
        ));
    }
    let root = IceoryxPath::new(root.as_bytes()).map_err(|e| format!("root: {e:?}"))?;
    config.global.prefix = prefix;
    config.global.set_root_path(&root);
    // A service whose creator died in the middle of it is waited for that long.
    config.global.creation_timeout = CREATION_WITHIN;
    Ok(config)
}

macro_rules! publish_subscribe {
    ($opened:ident, $factory:ident, $sender:ident, $receiver:ident, $payload:ty, $name:literal, $publishers:expr, $subscribers:expr, $buffer:expr) => {
        impl Wire {
            fn $factory(&self) -> Result<&PortFactory<ipc::Service, $payload, ()>, ServiceError> {
                if let Some(opened) = self.$opened.get() {
                    return Ok(opened);
                }
                let what = concat!("open the ", $name, " service");
                let name = $name.try_into().map_err(|e| self.refused(what, &e))?;
                let opened = self
                    .node
                    .service_builder(&name)
                    .publish_subscribe::<$payload>()
                    .max_publishers($publishers)
                    .max_subscribers($subscribers)
                    .max_nodes(NODES_MAX)
                    .subscriber_max_buffer_size($buffer)
                    .subscriber_max_borrowed_samples(2)
                    .history_size(0)
                    .enable_safe_overflow(true)
                    .open_or_create()
                    .map_err(|e| self.refused(what, &e))?;
                Ok(self.$opened.get_or_init(|| opened))
            }

            #[doc = concat!("A sender of the ", $name, " service.")]
            ///
            /// # Errors
            /// When shared memory refuses: another layout, too many senders.
            pub fn $sender(&self) -> Result<Publisher<ipc::Service, $payload, ()>, ServiceError> {
                let what = concat!("send on the ", $name, " service");
                self.$factory()?.publisher_builder().create().map_err(|e| self.refused(what, &e))
            }

            #[doc = concat!("A receiver of the ", $name, " service.")]
            ///
            /// # Errors
            /// When shared memory refuses: another layout, too many receivers.
            pub fn $receiver(&self) -> Result<Subscriber<ipc::Service, $payload, ()>, ServiceError> {
                let what = concat!("receive from the ", $name, " service");
                self.$factory()?
                    .subscriber_builder()
                    .buffer_size($buffer)
                    .create()
                    .map_err(|e| self.refused(what, &e))
            }
        }
    };
}

publish_subscribe!(
    trajectory,
    trajectory_service,
    trajectory_publisher,
    trajectory_subscriber,
    TrajectoryMessage,
    "trajectory",
    PUBLISHERS_MAX,
    TRAJECTORY_READERS_MAX,
    TRAJECTORY_BUFFER
);
publish_subscribe!(
    receipt,
    receipt_service,
    receipt_publisher,
    receipt_subscriber,
    Receipt,
    "receipt",
    1,
    SUBSCRIBERS_MAX,
    RECEIPT_BUFFER
);
publish_subscribe!(
    report,
    report_service,
    report_publisher,
    report_subscriber,
    Report,
    "report",
    1,
    SUBSCRIBERS_MAX,
    REPORT_BUFFER
);

macro_rules! request_response {
    ($factory:ident, $client:ident, $server:ident, $request:ty, $reply:ty, $name:literal) => {
        impl Wire {
            fn $factory(
                &self,
            ) -> Result<
                iceoryx2::service::port_factory::request_response::PortFactory<
                    ipc::Service,
                    $request,
                    (),
                    $reply,
                    (),
                >,
                ServiceError,
            > {
                let what = concat!("open the ", $name, " service");
                let name = $name.try_into().map_err(|e| self.refused(what, &e))?;
                self.node
                    .service_builder(&name)
                    .request_response::<$request, $reply>()
                    .max_clients(CLIENTS_MAX)
                    .max_servers(1)
                    .max_nodes(NODES_MAX)
                    .max_active_requests_per_client(2)
                    .max_response_buffer_size(2)
                    .enable_safe_overflow_for_requests(true)
                    .enable_safe_overflow_for_responses(true)
                    .open_or_create()
                    .map_err(|e| self.refused(what, &e))
            }

            #[doc = concat!("A client of the ", $name, " service.")]
            ///
            /// # Errors
            /// When shared memory refuses: another layout, too many clients.
            pub fn $client(&self) -> Result<Client<ipc::Service, $request, (), $reply, ()>, ServiceError> {
                let what = concat!("ask the ", $name, " service");
                self.$factory()?.client_builder().create().map_err(|e| self.refused(what, &e))
            }

            #[doc = concat!("The one server of the ", $name, " service.")]
            ///
            /// # Errors
            /// When shared memory refuses: another layout, a server that runs already.
            pub fn $server(&self) -> Result<Server<ipc::Service, $request, (), $reply, ()>, ServiceError> {
                let what = concat!("serve the ", $name, " service");
                self.$factory()?.server_builder().create().map_err(|e| self.refused(what, &e))
            }
        }
    };
}

request_response!(command_service, command_client, command_server, CommandRequest, CommandReply, "command");
request_response!(plan_service, plan_client, plan_server, PlanRequest, PlanReply, "plan");
request_response!(target_service, target_client, target_server, TargetRequest, TargetReply, "target");
request_response!(cloud_service, cloud_client, cloud_server, CloudRequest, SceneReply, "cloud");
request_response!(scene_service, scene_client, scene_server, SceneRequest, SceneReply, "scene");

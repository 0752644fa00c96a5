//! A sweep on a real Slurm: four nodes on this machine, one of which dies with its tasks.
//!
//! Skipped where Slurm or munge is not installed (Debian and Ubuntu: slurm-wlm and munge). Runs as root and as
//! any user; everything is in a temporary folder and listens on 127.0.0.1 alone, and all of it is ended afterwards.

#![cfg(target_os = "linux")]

use std::cell::RefCell;
use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// Tasks of the array.
const TASKS: usize = 16;

const GRID: &str = r#"
mission = "snap_l2.toml"
outputs = ["delta_e"]
sampling = "monte-carlo"
draws = 320
chunk_points = 10

[axes]
readout.line_time_ms = [10.0, 25.0, 50.0]
detector.temperature_k = { distribution = "normal", mean = 133.0, sigma = 2.0 }
"#;

/// In the environment of everything that a cluster runs: its folder.
const CLUSTER: &str = "CTIPLAN_TEST_CLUSTER";

/// A cluster of four nodes; ended when it is dropped.
struct Cluster {
    folder: TempDir,
    daemons: RefCell<Vec<Child>>,
}

impl Cluster {
    fn start() -> Cluster {
        let folder = tempfile::Builder::new().prefix("slurm").tempdir().unwrap();
        let cluster = Cluster { folder, daemons: RefCell::default() };
        // Slurm's daemons want to pass through, whoever runs them.
        fs::set_permissions(cluster.folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        let user = output(Command::new("id").arg("-un"));
        let host = output(Command::new("hostname").arg("-s"));
        let folder = cluster.folder.path().display();
        // All at once, so that all differ.
        let free: Vec<TcpListener> = (0..5).map(|_| TcpListener::bind(("127.0.0.1", 0)).unwrap()).collect();
        let ports: Vec<u16> = free.iter().map(|listener| listener.local_addr().unwrap().port()).collect();
        drop(free);
        let mut conf = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={}\nSlurmUser={user}\nSlurmdUser={user}\n\
             CommunicationParameters=NoInAddrAny,NoCtldInAddrAny\nAuthType=auth/munge\n\
             AuthInfo=socket={folder}/munge.sock,cred_expire=5\nStateSaveLocation={folder}/state\n\
             SlurmctldPidFile={folder}/slurmctld.pid\nSlurmdPidFile={folder}/slurmd.%n.pid\n\
             SlurmdSpoolDir={folder}/spool.%n\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n\
             JobAcctGatherType=jobacct_gather/none\nSelectType=select/cons_tres\nSelectTypeParameters=CR_Core\n\
             SlurmdParameters=config_overrides\nSlurmdTimeout=10\nReturnToService=2\nMpiDefault=none\n\
             SwitchType=switch/none\n",
            ports[0]
        );
        for (node, port) in (1..).zip(&ports[1..]) {
            conf.push_str(&format!(
                "NodeName=n{node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=2 RealMemory=1000\n"
            ));
        }
        conf.push_str("PartitionName=all Nodes=n[1-4] Default=YES MaxTime=INFINITE State=UP\n");
        fs::write(cluster.path("slurm.conf"), conf).unwrap();
        fs::create_dir(cluster.path("state")).unwrap();
        let mut key =
            fs::OpenOptions::new().write(true).create_new(true).mode(0o400).open(cluster.path("key")).unwrap();
        std::io::Write::write_all(&mut key, &fs::read("/proc/sys/kernel/random/uuid").unwrap().repeat(4)).unwrap();
        drop(key);
        let at = |option: &str, name: &str| format!("--{option}={}", cluster.path(name).display());
        cluster.daemon("munge", "munged", |command| {
            command.args(["--foreground", "--force", "--num-threads=2"]).args([
                at("key-file", "key"),
                at("socket", "munge.sock"),
                at("pid-file", "munge.pid"),
                at("log-file", "munge.log"),
                at("seed-file", "munge.seed"),
            ])
        });
        cluster.wait("munge", || cluster.path("munge.sock").exists());
        cluster.daemon("ctld", "slurmctld", |command| command.args(["-D", "-c"]));
        for node in 1..=4 {
            cluster.node(node);
        }
        cluster.wait("nodes", || cluster.try_run(&["sinfo", "-h", "-t", "idle", "-o", "%D"]).as_deref() == Some("4"));
        cluster
    }

    fn node(&self, node: u32) {
        let name = format!("n{node}");
        self.daemon(&name, "slurmd", |command| command.args(["-D", "-N", &name]).env("CTIPLAN_TEST_NODE", &name));
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command
            .current_dir(self.folder.path())
            .env("SLURM_CONF", self.path("slurm.conf"))
            .env(CLUSTER, self.folder.path());
        command
    }

    fn daemon(&self, name: &str, program: &str, with: impl FnOnce(&mut Command) -> &mut Command) {
        let log = |end: &str| fs::File::create(self.path(&format!("{name}.{end}"))).unwrap();
        let mut command = self.command(&find(program).expect("it was there a moment ago"));
        with(&mut command);
        let daemon = command.stdin(Stdio::null()).stdout(log("out")).stderr(log("err")).spawn().unwrap();
        self.daemons.borrow_mut().push(daemon);
    }

    fn try_run(&self, words: &[&str]) -> Option<String> {
        let run = self.command(&find(words[0])?).args(&words[1..]).output().unwrap();
        run.status.success().then(|| String::from_utf8(run.stdout).unwrap().trim().to_string())
    }

    fn run(&self, words: &[&str]) -> String {
        self.try_run(words).unwrap_or_else(|| panic!("{words:?} failed\n{}", self.logs()))
    }

    fn wait(&self, what: &str, done: impl Fn() -> bool) {
        let start = Instant::now();
        while !done() {
            assert!(start.elapsed() < Duration::from_secs(180), "waited in vain for {what}\n{}", self.logs());
            sleep(Duration::from_millis(50));
        }
    }

    fn logs(&self) -> String {
        let mut logs = String::new();
        for entry in fs::read_dir(self.folder.path()).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|end| end == "err" || end == "log") {
                logs.push_str(&format!("{}\n{}\n", path.display(), fs::read_to_string(&path).unwrap_or_default()));
            }
        }
        logs
    }

    /// Ends processes of this cluster, or of one of its nodes, at once, by their numbers.
    fn kill(&self, node: Option<&str>) -> usize {
        let marked =
            |environment: &[u8], mark: String| environment.split(|&byte| byte == 0).any(|said| said == mark.as_bytes());
        let mut killed = 0;
        for entry in fs::read_dir("/proc").unwrap().flatten() {
            let Some(id) = entry.file_name().to_str().and_then(|name| name.parse::<u32>().ok()) else { continue };
            let Ok(environment) = fs::read(entry.path().join("environ")) else { continue };
            let its = marked(&environment, format!("{CLUSTER}={}", self.folder.path().display()));
            let on_node = node.is_none_or(|node| {
                marked(&environment, format!("CTIPLAN_TEST_NODE={node}"))
                    || marked(&environment, format!("SLURMD_NODENAME={node}"))
            });
            if its && on_node && id != std::process::id() {
                killed += usize::from(Command::new("kill").args(["-9", &id.to_string()]).status().unwrap().success());
            }
        }
        killed
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // What is killed may have been about to start something.
        for _ in 0..20 {
            if self.kill(None) == 0 {
                break;
            }
            sleep(Duration::from_millis(50));
        }
        for daemon in self.daemons.get_mut() {
            let _ = daemon.wait();
        }
    }
}

fn output(command: &mut Command) -> String {
    String::from_utf8(command.output().unwrap().stdout).unwrap().trim().to_string()
}

/// A program, also where only an administrator's shell looks for it.
fn find(program: &str) -> Option<PathBuf> {
    let path = std::env::var("PATH").unwrap_or_default();
    let folders = path.split(':').chain(["/usr/sbin", "/usr/local/sbin"]);
    folders.map(|folder| Path::new(folder).join(program)).find(|path| path.is_file())
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn a_job_array_loses_nothing_and_doubles_nothing_when_a_node_dies() {
    let needed = ["slurmctld", "slurmd", "sbatch", "squeue", "sinfo", "munged"];
    if needed.iter().any(|program| find(program).is_none()) {
        crate::skipped::for_want_of("Slurm and munge");
        return;
    }
    let cluster = Cluster::start();
    fs::copy("missions/snap_l2.toml", cluster.path("snap_l2.toml")).unwrap();
    fs::write(cluster.path("grid.toml"), GRID).unwrap();
    let ctiplan = env!("CARGO_BIN_EXE_ctiplan");
    let sweep = |output: &str, more: &[&str]| {
        cluster.run(&[&[ctiplan, "sweep", "grid.toml", "--output", output], more].concat())
    };
    let tasks = TASKS.to_string();
    fs::write(cluster.path("sweep.sbatch"), sweep("all.parquet", &["--slurm", &tasks]) + "\n").unwrap();
    let job = cluster.run(&["sbatch", "--parsable", "sweep.sbatch"]);
    // As the script says, but for its own words around the command.
    let script = fs::read_to_string(cluster.path("sweep.sbatch")).unwrap();
    let wrapped = script.lines().find(|line| line.contains("--wrap")).expect("how to collect");
    let collect = wrapped.split('"').nth(1).expect("a command in quotes").to_string();
    cluster.run(&["sbatch", &format!("--dependency=afterany:{job}"), "--wrap", &collect]);

    let parts = cluster.path("all.parquet.parts");
    cluster.wait("tasks on n2 that have written something", || {
        let on_n2 = cluster.run(&["squeue", "-h", "-t", "R", "-w", "n2"]);
        !on_n2.is_empty() && fs::read_dir(&parts).is_ok_and(|entries| entries.count() > 3)
    });
    assert!(cluster.kill(Some("n2")) >= 2, "a daemon and a task at least");

    let empty = || cluster.run(&["squeue", "-h"]).is_empty();
    cluster.wait("the queue to be empty", empty);
    // A task that was killed alone would not have been requeued: the files say what is missing.
    let missing = sweep("all.parquet", &["--missing", &tasks]);
    if !missing.is_empty() {
        cluster.run(&["sbatch", &format!("--array={missing}"), "sweep.sbatch"]);
        cluster.wait("the queue to be empty", empty);
        sweep("all.parquet", &["--collect"]);
    }
    sweep("alone.parquet", &[]);
    let read = |name: &str| fs::read(cluster.path(name)).unwrap_or_else(|_| panic!("no {name}\n{}", cluster.logs()));
    assert_eq!(read("all.parquet"), read("alone.parquet"), "not what one machine makes");
    assert!(!parts.exists());
}

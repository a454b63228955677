//! The explorer over a slow link: the real binary in a pseudo-terminal behind 5 kB/s with 200 ms there and back, whose buffers
//! hold all that is sent, as those of ssh do. It measures, and takes minutes:
//! `cargo test --release --test sprint slow_link -- --ignored --nocapture`.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, PtySize, native_pty_system};

const BYTES_PER_SECOND: f64 = 5000.0;
/// The time that a byte takes each way.
const ONE_WAY: Duration = Duration::from_millis(100);
const TICK: Duration = Duration::from_millis(5);
const QUESTION: &[u8] = b"\x1b[5n";
const ANSWER: &[u8] = b"\x1b[0n";

/// A terminal at the far end of the link.
struct Far {
    output: Receiver<Vec<u8>>,
    keys: Box<dyn Write + Send>,
    child: Box<dyn Child + Send + Sync>,
    _master: Box<dyn portable_pty::MasterPty + Send>,
    screen: vt100::Parser,
    /// What was sent and has not arrived, with the time at which the link has it.
    on_the_way: VecDeque<(Instant, u8)>,
    /// When the link will have taken in all that was sent.
    busy_until: Instant,
    /// What the terminal sends, with the time at which it arrives.
    back: VecDeque<(Instant, Vec<u8>)>,
    /// The last bytes that arrived, to find questions in.
    tail: Vec<u8>,
    arrived: usize,
}

impl Far {
    fn open(arguments: &[&str]) -> Far {
        let size = PtySize { rows: 24, cols: 80, pixel_width: 800, pixel_height: 480 };
        let pair = native_pty_system().openpty(size).unwrap();
        let mut line = CommandBuilder::new(env!("CARGO_BIN_EXE_sprint"));
        line.args(arguments);
        line.cwd(env!("CARGO_MANIFEST_DIR"));
        for name in ["TMUX", "CI", "NO_COLOR", "LC_ALL", "LC_CTYPE", "TERM_PROGRAM", "KITTY_WINDOW_ID", "WT_SESSION"] {
            line.env_remove(name);
        }
        let state = std::env::temp_dir().join("sprint-slow-link");
        for (name, value) in [("TERM", "xterm-256color"), ("COLORTERM", "truecolor"), ("LANG", "en_US.UTF-8")] {
            line.env(name, value);
        }
        line.env("SSH_CONNECTION", "far");
        line.env("XDG_STATE_HOME", &state);
        line.env("XDG_CONFIG_HOME", &state);
        let child = pair.slave.spawn_command(line).unwrap();
        drop(pair.slave);
        let mut reader = pair.master.try_clone_reader().unwrap();
        let (send, output) = channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = reader.read(&mut bytes) {
                if send.send(bytes[..count].to_vec()).is_err() {
                    return;
                }
            }
        });
        let now = Instant::now();
        let keys = pair.master.take_writer().unwrap();
        Far {
            output,
            keys,
            child,
            _master: pair.master,
            screen: vt100::Parser::new(24, 80, 0),
            on_the_way: VecDeque::new(),
            busy_until: now,
            back: VecDeque::new(),
            tail: Vec::new(),
            arrived: 0,
        }
    }

    /// Lets the link work for a moment.
    fn tick(&mut self) {
        std::thread::sleep(TICK);
        let now = Instant::now();
        while let Ok(bytes) = self.output.try_recv() {
            for byte in bytes {
                self.busy_until = self.busy_until.max(now) + Duration::from_secs_f64(1.0 / BYTES_PER_SECOND);
                self.on_the_way.push_back((self.busy_until + ONE_WAY, byte));
            }
        }
        while self.on_the_way.front().is_some_and(|(due, _)| *due <= now) {
            let (_, byte) = self.on_the_way.pop_front().unwrap();
            self.screen.process(&[byte]);
            self.arrived += 1;
            self.tail.push(byte);
            if self.tail.ends_with(QUESTION) {
                self.back.push_back((now + ONE_WAY, ANSWER.to_vec()));
                self.tail.clear();
            } else if self.tail.len() > 64 {
                self.tail.drain(..60);
            }
        }
        while self.back.front().is_some_and(|(due, _)| *due <= now) {
            let (_, bytes) = self.back.pop_front().unwrap();
            self.keys.write_all(&bytes).unwrap();
            self.keys.flush().unwrap();
        }
    }

    fn press(&mut self, key: &str) {
        self.back.push_back((Instant::now() + ONE_WAY, key.as_bytes().to_vec()));
    }

    fn text(&self) -> String {
        self.screen.screen().contents()
    }

    /// How long it takes until the screen shows something.
    fn until(&mut self, what: &str, holds: impl Fn(&str) -> bool) -> Duration {
        let since = Instant::now();
        while !holds(&self.text()) {
            self.tick();
            assert!(since.elapsed() < Duration::from_secs(90), "no {what}:\n{}", self.text());
        }
        since.elapsed()
    }

    fn pass(&mut self, time: Duration) {
        let since = Instant::now();
        while since.elapsed() < time {
            self.tick();
        }
    }

    /// The step that the screen shows.
    fn step(&self) -> u32 {
        step(&self.text())
    }
}

fn step(text: &str) -> u32 {
    let after = text.split("main ").nth(1).unwrap_or_default();
    after.split('/').next().and_then(|number| number.trim().parse().ok()).unwrap_or(0)
}

/// What was measured of a picture mode.
struct Measured {
    /// How long `space` took to show: a run that pauses, and one that begins.
    pauses: Vec<Duration>,
    runs: Vec<Duration>,
    steps: Vec<Duration>,
    /// While it runs.
    bytes_per_second: f64,
    shown_per_second: f64,
}

fn measure(protocol: &str, more: &[&str]) -> Measured {
    let arguments = [&["explore", "--policy", "random", "--seed", "3", "--graphics", protocol], more].concat();
    let mut far = Far::open(&arguments);
    far.until("run", |text| text.contains("running"));
    let (mut pauses, mut runs, mut shown) = (Vec::new(), Vec::new(), 0);
    let (mut ran, mut bytes) = (Duration::ZERO, 0);
    for pause in 0..5 {
        let (began, before) = (Instant::now(), far.arrived);
        let mut last = far.step();
        // At other moments of a frame each time.
        while began.elapsed() < Duration::from_millis(4000 + 170 * pause) {
            far.tick();
            if far.step() != last {
                (last, shown) = (far.step(), shown + 1);
            }
        }
        (ran, bytes) = (ran + began.elapsed(), bytes + far.arrived - before);
        far.press(" ");
        pauses.push(far.until("pause", |text| text.contains("paused")));
        // While the picture of the pause is on its way, too.
        far.pass(Duration::from_millis(300 + 250 * pause));
        far.press(" ");
        runs.push(far.until("run", |text| text.contains("running")));
    }
    far.press(" ");
    far.until("pause", |text| text.contains("paused"));
    far.pass(Duration::from_secs(8));
    let mut steps = Vec::new();
    for _ in 0..5 {
        let before = far.step();
        far.press("n");
        steps.push(far.until("step", |text| step(text) > before));
        far.pass(Duration::from_secs(4));
    }
    far.child.kill().unwrap();
    far.child.wait().unwrap();
    let seconds = ran.as_secs_f64();
    Measured {
        pauses,
        runs,
        steps,
        bytes_per_second: bytes as f64 / seconds,
        shown_per_second: f64::from(shown) / seconds,
    }
}

#[test]
#[ignore = "it measures times, and takes minutes"]
fn slow_link_in_every_picture_mode() {
    let mut late = Vec::new();
    eprintln!(
        "| pictures | pauses, median | longest | runs, median | longest | a step shows, median | longest | kB/s | steps shown a second |"
    );
    eprintln!("|---|---|---|---|---|---|---|---|---|");
    let modes: [(&str, &[&str]); 6] = [
        ("halfblocks", &[]),
        ("ascii", &[]),
        ("kitty", &[]),
        ("iterm2", &[]),
        ("sixel", &[]),
        ("halfblocks", &["--bandwidth", "2"]),
    ];
    for (protocol, more) in modes {
        let Measured { mut pauses, mut runs, mut steps, bytes_per_second, shown_per_second } = measure(protocol, more);
        pauses.sort();
        runs.sort();
        steps.sort();
        let seconds = |time: &Duration| format!("{:.2} s", time.as_secs_f64());
        let (middle, last) = (pauses.len() / 2, pauses.len() - 1);
        eprintln!(
            "| {protocol} {} | {} | {} | {} | {} | {} | {} | {:.1} | {shown_per_second:.1} |",
            more.join(" "),
            seconds(&pauses[middle]),
            seconds(&pauses[last]),
            seconds(&runs[middle]),
            seconds(&runs[last]),
            seconds(&steps[middle]),
            seconds(&steps[last]),
            bytes_per_second / 1000.0
        );
        let longest = pauses[last].max(runs[last]);
        if longest > Duration::from_secs(1) {
            late.push(format!("{protocol} {}: {}", more.join(" "), seconds(&longest)));
        }
    }
    assert!(late.is_empty(), "`space` takes more than a second: {}", late.join("; "));
}

#[test]
#[ignore = "it measures times, and takes half a minute"]
fn slow_link_in_another_environment() {
    let server = crate::environments::Server::start("none");
    let environment = format!("openenv:{}", server.url);
    for protocol in ["halfblocks", "sixel"] {
        let mut far = Far::open(&["explore", "--env", &environment, "--graphics", protocol, "--policy", "random"]);
        far.until("run", |text| text.contains("random acts"));
        let mut longest = Duration::ZERO;
        for moment in 0..5 {
            far.pass(Duration::from_millis(1500 + 170 * moment));
            // An episode that is over begins anew.
            let is_running = far.text().contains("running");
            far.press(if is_running { " " } else { "0 " });
            longest = longest.max(far.until("answer", |text| text.contains("running") != is_running));
        }
        far.child.kill().unwrap();
        far.child.wait().unwrap();
        eprintln!("{protocol}: {:.2} s at most", longest.as_secs_f64());
        assert!(longest <= Duration::from_secs(1), "{protocol}: {longest:?}");
    }
}

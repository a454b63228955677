//! The socket that something that runs listens on.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;

use super::message::{Answer, Kind, Order, Question, Status};
use super::tail::Tail;
use super::{client, runtime_folder};

/// Something that can be asked and steered.
pub(crate) trait Controlled: Send + Sync {
    /// How far it is.
    fn status(&self) -> Status;

    /// Does what it is asked; what was done, in words.
    ///
    /// # Errors
    /// When it cannot do that; says why.
    fn obey(&self, order: Order) -> Result<String, String>;

    /// What happens in it.
    fn tail(&self) -> &Tail;
}

/// Listens until it is dropped.
pub(crate) struct ControlServer {
    path: PathBuf,
    controlled: Arc<dyn Controlled>,
}

/// The longest question.
const LONGEST: u64 = 64 * 1024;
/// How long one who connected may take to ask, or to take in the answer.
const PATIENCE: Duration = Duration::from_secs(5);

impl ControlServer {
    /// Listens in the user's own folder.
    ///
    /// # Errors
    /// When the socket cannot be made.
    pub(crate) fn open(kind: Kind, controlled: Arc<dyn Controlled>) -> anyhow::Result<ControlServer> {
        ControlServer::open_in(&runtime_folder::path(), kind, controlled)
    }

    fn open_in(folder: &Path, kind: Kind, controlled: Arc<dyn Controlled>) -> anyhow::Result<ControlServer> {
        runtime_folder::make(folder)?;
        client::clear_away_stale(folder);
        let pid = std::process::id();
        let name = |number: u32| match number {
            1 => format!("{}-{pid}.sock", kind.name()),
            _ => format!("{}-{pid}-{number}.sock", kind.name()),
        };
        let (listener, path) = (1..100)
            .map(|number| folder.join(name(number)))
            .find_map(|path| Some((UnixListener::bind(&path).ok()?, path)))
            .with_context(|| format!("no socket could be made in {}", folder.display()))?;
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o600))?;
        let answers = controlled.clone();
        std::thread::Builder::new().name("control".into()).spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let controlled = answers.clone();
                let serve = move || {
                    // One who leaves before the answer misses it.
                    let _ = serve(stream, &*controlled, runtime_folder::own_user());
                };
                let _ = std::thread::Builder::new().name("control".into()).spawn(serve);
            }
        })?;
        Ok(ControlServer { path, controlled })
    }
}

impl Drop for ControlServer {
    fn drop(&mut self) {
        self.controlled.tail().end();
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Answers one question of a process of that user.
fn serve(stream: UnixStream, controlled: &dyn Controlled, user: u32) -> anyhow::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let peer = rustix::net::sockopt::socket_peercred(&stream)?;
    if peer.uid.as_raw() != user {
        return say(&stream, &Answer::Refused("it is another user's".into()));
    }
    let mut line = String::new();
    BufReader::new((&stream).take(LONGEST)).read_line(&mut line)?;
    let answer = match serde_json::from_str(&line) {
        Ok(Question::Status) => Answer::Status(controlled.status()),
        Ok(Question::Do { order }) => controlled.obey(order).map_or_else(Answer::Refused, Answer::Done),
        Ok(Question::Tail) => return tell_all(&stream, controlled.tail()),
        Err(problem) => Answer::Refused(format!("the question is not understood: {problem}")),
    };
    say(&stream, &answer)
}

fn tell_all(stream: &UnixStream, tail: &Tail) -> anyhow::Result<()> {
    tail.listen().iter().try_for_each(|line| say(stream, &Answer::Line(line)))
}

fn say(mut stream: &UnixStream, answer: &Answer) -> anyhow::Result<()> {
    let mut line = serde_json::to_vec(answer)?;
    line.push(b'\n');
    Ok(stream.write_all(&line)?)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::super::message::{Progress, State};
    use super::*;

    #[derive(Default)]
    struct Recorder {
        orders: Mutex<Vec<Order>>,
        tail: Tail,
    }

    impl Controlled for Recorder {
        fn status(&self) -> Status {
            Status {
                pid: std::process::id(),
                kind: Kind::Eval,
                what: "runs/a".into(),
                state: State::Running,
                progress: Progress::default(),
                instruction: None,
            }
        }

        fn obey(&self, order: Order) -> Result<String, String> {
            if order == Order::Stop {
                return Err("it never stops".into());
            }
            self.orders.lock().unwrap().push(order);
            Ok("done".into())
        }

        fn tail(&self) -> &Tail {
            &self.tail
        }
    }

    #[test]
    fn questions_are_answered_and_two_of_a_kind_have_sockets_of_their_own() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path().join("sprint");
        let recorder = Arc::new(Recorder::default());
        let first = ControlServer::open_in(&folder, Kind::Eval, recorder.clone()).unwrap();
        let second = ControlServer::open_in(&folder, Kind::Eval, recorder.clone()).unwrap();
        assert_ne!(first.path, second.path);
        assert_eq!(first.path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        let running = client::running_in(&folder).unwrap();
        assert_eq!(running.iter().map(|it| it.status.what.as_str()).collect::<Vec<_>>(), ["runs/a", "runs/a"]);
        assert_eq!(running[0].order(Order::Instruct("Go.".into())).unwrap(), "done");
        assert_eq!(*recorder.orders.lock().unwrap(), [Order::Instruct("Go.".into())]);
        assert!(running[0].order(Order::Stop).unwrap_err().to_string().contains("it never stops"));
        recorder.tail.say("began".into());
        let mut lines = Vec::new();
        let mut heard = running[1].tail().unwrap();
        lines.extend(heard.next());
        drop(second);
        lines.extend(heard);
        assert_eq!(lines.into_iter().collect::<anyhow::Result<Vec<_>>>().unwrap(), ["began"]);
        drop(first);
        assert!(client::running_in(&folder).unwrap().is_empty());
    }

    #[test]
    fn a_socket_that_a_killed_process_left_is_cleared_away() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path().join("sprint");
        runtime_folder::make(&folder).unwrap();
        let left = folder.join("eval-1.sock");
        drop(UnixListener::bind(&left).unwrap());
        assert!(left.exists());
        assert!(client::running_in(&folder).unwrap().is_empty());
        assert!(!left.exists());
    }

    #[test]
    fn a_process_of_another_user_is_refused_before_its_question_is_read() {
        let (own, other) = UnixStream::pair().unwrap();
        let recorder = Recorder::default();
        serve(own, &recorder, runtime_folder::own_user() + 1).unwrap();
        let mut answer = String::new();
        BufReader::new(other).read_line(&mut answer).unwrap();
        assert_eq!(answer, "{\"refused\":\"it is another user's\"}\n");
    }

    #[test]
    fn a_question_that_is_no_json_is_refused_and_nothing_is_done() {
        let (own, mut other) = UnixStream::pair().unwrap();
        other.write_all(b"{\"ask\":\"dance\"}\n").unwrap();
        let recorder = Recorder::default();
        serve(own, &recorder, runtime_folder::own_user()).unwrap();
        let mut answer = String::new();
        BufReader::new(other).read_line(&mut answer).unwrap();
        assert!(answer.starts_with("{\"refused\":\"the question is not understood"), "{answer}");
    }
}

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use serde_json::json;
use sha2::{Digest, Sha256};

use super::{Hub, HubCache, HubName};
use crate::data::json::hex;

const COMMIT: &str = "0123456789abcdef0123456789abcdef01234567";
const CONFIG: &str = "hello\n";
/// As git calls it.
const CONFIG_NAME: &str = "ce013625030ba8dba906f756967f9e9ca394464a";

/// A server that stands for the Hub, with one repository; what was asked of it.
struct StandIn {
    endpoint: String,
    asked: Arc<Mutex<Vec<String>>>,
}

/// What is wrong with it.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// The weights that come are other ones.
    OtherWeights,
    /// They are longer than was told.
    LongWeights,
    /// They are no safetensors.
    Pickled,
}

impl StandIn {
    fn start(fault: Fault) -> StandIn {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("http://{}", listener.local_addr().unwrap());
        let asked = Arc::new(Mutex::new(Vec::new()));
        let noted = asked.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                answer(stream.unwrap(), fault, &noted);
            }
        });
        StandIn { endpoint, asked }
    }

    fn hub(&self) -> Hub {
        Hub::new(&self.endpoint, Some("secret".into()))
    }
}

fn answer(mut stream: TcpStream, fault: Fault, asked: &Mutex<Vec<String>>) {
    let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
    let path = lines.next().unwrap().unwrap().split(' ').nth(1).unwrap().to_owned();
    let head: Vec<String> = lines.map(Result::unwrap).take_while(|line| !line.is_empty()).collect();
    let is_known = head.iter().any(|line| line.to_lowercase() == "authorization: bearer secret");
    let weights = if fault == Fault::OtherWeights { "other" } else { "seven" };
    let weights = if fault == Fault::LongWeights { "seven and more" } else { weights };
    let weights_name = if fault == Fault::Pickled { "pytorch_model.bin" } else { "model.safetensors" };
    let list = json!({"sha": COMMIT, "siblings": [
        {"rfilename": "config.json", "size": CONFIG.len(), "blobId": CONFIG_NAME},
        {"rfilename": weights_name, "size": 5, "blobId": CONFIG_NAME, "lfs": {"sha256": hex(&Sha256::digest("seven"))}},
    ]});
    let resolve = format!("/org/ball/resolve/{COMMIT}");
    let (status, more, body) = match path.as_str() {
        "/api/models/org/ball/revision/main?blobs=true" | "/api/models/org/ball/revision/refs%2Fpr%2F1?blobs=true" => {
            ("200 OK", String::new(), list.to_string())
        }
        path if path == format!("{resolve}/config.json") => ("200 OK", String::new(), CONFIG.into()),
        // Large files lie elsewhere, where the token must not go.
        path if path == format!("{resolve}/model.safetensors") && is_known => {
            ("302 Found", "Location: /elsewhere/weights\r\n".into(), String::new())
        }
        "/elsewhere/weights" if !is_known => ("200 OK", String::new(), weights.into()),
        _ => ("404 Not Found", String::new(), String::new()),
    };
    asked.lock().unwrap().push(path);
    let length = body.len();
    let whole = format!("HTTP/1.1 {status}\r\n{more}Content-Length: {length}\r\nConnection: close\r\n\r\n{body}");
    // Whoever asked may have left by now.
    let _ = stream.write_all(whole.as_bytes());
}

fn folder(hub: &Hub, cache: &Path, named: &str) -> Result<(PathBuf, Vec<String>), String> {
    let (name, mut notes) = (HubName::of_path(Path::new(named)).unwrap(), Vec::new());
    let found = name.folder(hub, &HubCache::new(cache.to_owned()), &mut |note| notes.push(note.to_owned()));
    found.map(|found| (found, notes)).map_err(|error| format!("{error:#}"))
}

/// A server that is not there.
fn nobody() -> Hub {
    Hub::new(&format!("http://{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()), None)
}

#[test]
fn a_checkpoint_is_fetched_once_checked_and_then_found_without_the_hub() {
    let (base, stand_in) = (tempfile::tempdir().unwrap(), StandIn::start(Fault::None));
    let (found, notes) = folder(&stand_in.hub(), base.path(), "org/ball").unwrap();
    assert_eq!(found, base.path().join("models--org--ball/snapshots").join(COMMIT));
    assert_eq!(std::fs::read_to_string(found.join("model.safetensors")).unwrap(), "seven");
    assert_eq!(notes.len(), 2, "each file is told: {notes:?}");
    let before = stand_in.asked.lock().unwrap().len();
    let again = folder(&stand_in.hub(), base.path(), "org/ball@refs/pr/1").unwrap();
    assert_eq!(again, (found.clone(), Vec::new()));
    assert_eq!(stand_in.asked.lock().unwrap().len(), before + 1, "only what the revision holds is asked");
    let (without, notes) = folder(&nobody(), base.path(), "org/ball").unwrap();
    assert!(without == found && notes[0].contains("taken as it was fetched before"), "{notes:?}");
    assert_eq!(folder(&nobody(), base.path(), &format!("org/ball@{COMMIT}")).unwrap(), (found, Vec::new()));
}

#[test]
fn what_is_not_what_the_hub_announced_is_not_kept() {
    for (fault, told) in [
        (Fault::OtherWeights, "its digest is"),
        (Fault::LongWeights, "5 bytes were announced, 6 or more came"),
        (Fault::Pickled, "weights in other formats are not read"),
    ] {
        let base = tempfile::tempdir().unwrap();
        let said = folder(&StandIn::start(fault).hub(), base.path(), "org/ball").unwrap_err();
        assert!(said.contains(told) && !said.contains('\n'), "{said}");
        assert!(!base.path().join("models--org--ball/snapshots").exists());
        let blobs = base.path().join("models--org--ball/blobs").read_dir();
        assert!(blobs.map_or(0, Iterator::count) <= 1, "only the configuration is kept");
    }
}

#[test]
fn a_damaged_cache_is_told() {
    let (base, stand_in) = (tempfile::tempdir().unwrap(), StandIn::start(Fault::None));
    let (found, _) = folder(&stand_in.hub(), base.path(), "org/ball").unwrap();
    std::fs::write(found.join("model.safetensors"), "eight").unwrap();
    assert!(folder(&stand_in.hub(), base.path(), "org/ball").unwrap_err().contains("damaged: remove it"));
}

#[test]
fn where_there_is_no_network_or_no_such_name_one_sentence_says_so() {
    let (base, stand_in) = (tempfile::tempdir().unwrap(), StandIn::start(Fault::None));
    for (hub, told) in [(nobody(), "cannot be reached"), (stand_in.hub(), "has none of that name and revision")] {
        let said = folder(&hub, base.path(), "org/cube").unwrap_err();
        assert!(
            said.starts_with("org/cube: neither a folder here nor in the Hub's cache") && said.contains(told),
            "{said}"
        );
        assert!(!said.contains('\n'), "{said}");
    }
}

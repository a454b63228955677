//! What is asked of the Hub: what a revision holds, and the contents of its files.

use std::io::{self, Read};
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use serde::Deserialize;

use super::cache::HubCache;
use super::git_name;
use super::name::{HubName, is_hex};
use super::revision::{FILES, HubFile, Revision};
use crate::data::atomic_file;

/// The Hub, or a server that stands for it.
pub(crate) struct Hub {
    agent: ureq::Agent,
    endpoint: String,
    token: Option<String>,
    is_offline: bool,
}

/// What the Hub says of a revision.
#[derive(Deserialize)]
struct Said {
    sha: String,
    siblings: Vec<SaidFile>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SaidFile {
    rfilename: String,
    size: Option<u64>,
    blob_id: Option<String>,
    lfs: Option<SaidLarge>,
}

#[derive(Deserialize)]
struct SaidLarge {
    sha256: String,
}

/// The Hub itself.
const ENDPOINT: &str = "https://huggingface.co";
/// How long is waited for a connection, and for each part of an answer.
const PATIENCE: Duration = Duration::from_secs(20);
/// The longest list of a revision's files.
const LONGEST_LIST: u64 = 16 << 20;

impl Hub {
    /// The Hub at that address.
    pub(crate) fn new(endpoint: &str, token: Option<String>) -> Hub {
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_connect(Some(PATIENCE))
            .timeout_per_read(Some(PATIENCE))
            .user_agent(concat!("sprint/", env!("CARGO_PKG_VERSION")))
            .build();
        let agent = ureq::Agent::new_with_config(config);
        Hub { agent, endpoint: endpoint.trim_end_matches('/').to_owned(), token, is_offline: false }
    }

    /// As the Hub's other programs are told by `HF_ENDPOINT`, `HF_TOKEN` and `HF_HUB_OFFLINE`.
    pub(crate) fn of_user() -> Hub {
        let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
        let is_offline = set("HF_HUB_OFFLINE").is_some_and(|value| !["0", "false", "no"].contains(&value.as_str()));
        Hub { is_offline, ..Hub::new(&set("HF_ENDPOINT").unwrap_or_else(|| ENDPOINT.into()), set("HF_TOKEN")) }
    }

    /// Whether nothing may be asked of it.
    pub(super) fn is_offline(&self) -> bool {
        self.is_offline
    }

    fn get(&self, url: &str) -> anyhow::Result<ureq::http::Response<ureq::Body>> {
        ensure!(!self.is_offline, "HF_HUB_OFFLINE is set");
        let request = self.agent.get(url);
        // The token goes to the Hub alone: it is not sent on where the Hub redirects.
        let request = match &self.token {
            Some(token) => request.header("Authorization", format!("Bearer {token}")),
            None => request,
        };
        let response = request.call().with_context(|| format!("{} cannot be reached", self.endpoint))?;
        match response.status().as_u16() {
            200 => Ok(response),
            401 | 403 => {
                bail!("{} has none of that name, or not for everybody: HF_TOKEN opens what is yours", self.endpoint)
            }
            404 => bail!("{} has none of that name and revision", self.endpoint),
            status => bail!("{} answers with status {status}", self.endpoint),
        }
    }

    /// What a revision holds.
    ///
    /// # Errors
    /// When the Hub cannot be reached, has none such, or that is no checkpoint in safetensors.
    pub(super) fn revision(&self, name: &HubName) -> anyhow::Result<Revision> {
        let revision = name.revision.replace('/', "%2F");
        let url = format!("{}/api/models/{}/revision/{revision}?blobs=true", self.endpoint, name.repository);
        let mut response = self.get(&url)?;
        let said = response.body_mut().with_config().limit(LONGEST_LIST).read_to_vec();
        let said: Said = serde_json::from_slice(&said.context("its answer broke off")?)
            .with_context(|| format!("{} answers strangely", self.endpoint))?;
        ensure!(is_hex(&said.sha, 40), "{} answers strangely: {:?} is no commit", self.endpoint, said.sha);
        let file = |wanted: &'static str| -> anyhow::Result<HubFile> {
            let Some(found) = said.siblings.iter().find(|file| file.rfilename == wanted) else {
                bail!(
                    "it has no {wanted}: a checkpoint has {}; weights in other formats are not read",
                    FILES.join(" and ")
                );
            };
            let content = found.lfs.as_ref().map(|large| large.sha256.clone()).or_else(|| found.blob_id.clone());
            let content = content.filter(|content| git_name::is_one(content));
            let content = content.with_context(|| format!("the digest of its {wanted} is not given"))?;
            Ok(HubFile { name: wanted, size: found.size.context("its size is not given")?, content })
        };
        let files = FILES.into_iter().map(file).collect::<anyhow::Result<_>>()?;
        Ok(Revision { commit: said.sha, files })
    }

    /// Fetches a file's content into the cache, and checks it.
    ///
    /// # Errors
    /// When it cannot be fetched or written, or is another one than was told.
    pub(super) fn download(
        &self,
        name: &HubName,
        commit: &str,
        file: &HubFile,
        cache: &HubCache,
    ) -> anyhow::Result<()> {
        let url = format!("{}/{}/resolve/{commit}/{}", self.endpoint, name.repository, file.name);
        let response = self.get(&url)?;
        let path = cache.blob(name, file);
        let mut kept = atomic_file::begin(&path).with_context(|| format!("cannot write {}", path.display()))?;
        let mut body = response.into_body().into_with_config().limit(file.size + 1).reader().take(file.size + 1);
        let size = io::copy(&mut body, &mut kept).with_context(|| format!("{} broke off", file.name))?;
        ensure!(size == file.size, "{}: {} bytes were announced, {size} or more came", file.name, file.size);
        let found = git_name::of(kept.path(), &file.content)?;
        ensure!(found == file.content, "{}: its digest is {found}, and {} was announced", file.name, file.content);
        atomic_file::keep(kept, &path).with_context(|| format!("cannot write {}", path.display()))
    }
}

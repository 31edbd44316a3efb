//! A blocking client of any OpenAI-compatible `/v1/chat/completions`: OpenAI, vLLM, Ollama, llama.cpp.
//!
//! It ends in bounded time, never sends more requests than allowed, and reads no answer without end. What a server says is
//! never trusted; the key is sent to it and goes nowhere else.

use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use base64::Engine;
use serde::{Deserialize, Serialize};
use ureq::http::HeaderValue;

use super::{LanguageModel, PictureQuestion, Usage};
use crate::error::{Error, Result};

/// Longer answers are refused: ours are a line or two.
const MAX_ANSWER_BYTES: u64 = 1 << 20;
/// After this many failed questions in a row the server is not asked again in this run.
const GIVE_UP_AFTER: usize = 5;

/// A key from an environment variable. It has no `Display`, and its `Debug` names the variable only.
#[derive(Clone)]
pub struct ApiKey {
    variable: String,
    secret: String,
    header: HeaderValue,
}

impl ApiKey {
    /// The key in an environment variable; `None` where it is not set, or empty.
    ///
    /// # Errors
    /// Where no HTTP header can carry it.
    pub fn from_env(variable: &str) -> Result<Option<Self>> {
        let value = std::env::var_os(variable).map(|v| v.to_string_lossy().trim().to_owned()).unwrap_or_default();
        if value.is_empty() { Ok(None) } else { Self::new(variable, &value).map(Some) }
    }

    /// A key that came from `variable`, the name that messages use.
    ///
    /// # Errors
    /// Where no HTTP header can carry it.
    pub fn new(variable: &str, secret: &str) -> Result<Self> {
        let mut header = HeaderValue::from_str(&format!("Bearer {secret}"))
            .map_err(|_| Error::Vlm(format!("the key in {variable} holds characters that no HTTP header can carry")))?;
        header.set_sensitive(true);
        Ok(Self { variable: variable.to_owned(), secret: secret.to_owned(), header })
    }
}

impl fmt::Debug for ApiKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Key(from {})", self.variable)
    }
}

/// How long, how often, how much.
#[derive(Debug, Clone, PartialEq)]
pub struct RequestLimits {
    /// Until a connection stands.
    pub connect: Duration,
    /// For one request, until its answer is complete.
    pub request: Duration,
    /// Requests for one question.
    pub tries: usize,
    /// Pause before the second request; doubled before each further one.
    pub first_pause: Duration,
    /// All requests and pauses of one question; no request begins after it.
    pub patience: Duration,
    /// Requests under way at the same time.
    pub at_once: usize,
    /// Requests in all, repetitions included.
    pub max_requests: usize,
}

impl Default for RequestLimits {
    fn default() -> Self {
        Self {
            connect: Duration::from_secs(10),
            request: Duration::from_secs(120),
            tries: 4,
            first_pause: Duration::from_secs(1),
            patience: Duration::from_secs(300),
            at_once: 4,
            max_requests: 1000,
        }
    }
}

/// A server and one of its models.
pub struct Server {
    agent: ureq::Agent,
    endpoint: String,
    model: String,
    key: Option<ApiKey>,
    limits: RequestLimits,
    slots: Slots,
    sent: AtomicUsize,
    failed_in_a_row: AtomicUsize,
    usage: Mutex<Usage>,
}

impl fmt::Debug for Server {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Server")
            .field("endpoint", &self.endpoint)
            .field("model", &self.model)
            .field("key", &self.key)
            .field("limits", &self.limits)
            .finish_non_exhaustive()
    }
}

/// Why a request gave no answer.
enum RequestFault {
    /// Nothing will ever work: the run ends.
    Fatal(String),
    /// May work later; after this pause, where the server says one.
    Passing(String, Option<Duration>),
    /// Asking the same again gives the same.
    Final(String),
}

impl Server {
    /// A server at a base address, with or without a trailing `/v1`.
    ///
    /// # Errors
    /// Where the address cannot be used.
    pub fn new(url: &str, model: &str, key: Option<ApiKey>, limits: RequestLimits) -> Result<Self> {
        let endpoint = endpoint(url)?;
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            // A redirect would carry pictures, and perhaps the key, to somebody else.
            .max_redirects(0)
            .timeout_connect(Some(limits.connect))
            .timeout_global(Some(limits.request))
            .user_agent(concat!("paws/", env!("CARGO_PKG_VERSION")));
        // A proxy for the world does not know this machine.
        let config = if is_loopback(url) { config.proxy(None) } else { config };
        Ok(Self {
            agent: ureq::Agent::new_with_config(config.build()),
            endpoint,
            model: model.to_owned(),
            key,
            slots: Slots { free: Mutex::new(limits.at_once.max(1)), freed: Condvar::new() },
            limits,
            sent: AtomicUsize::new(0),
            failed_in_a_row: AtomicUsize::new(0),
            usage: Mutex::default(),
        })
    }

    fn count(&self) -> MutexGuard<'_, Usage> {
        self.usage.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes one of the allowed requests; `false` where none is left.
    fn reserve(&self) -> bool {
        self.sent.fetch_add(1, Ordering::Relaxed) < self.limits.max_requests
    }

    fn failed(&self, reason: &str) {
        self.failed_in_a_row.fetch_add(1, Ordering::Relaxed);
        self.count().fail(reason);
    }

    fn body(&self, question: &PictureQuestion) -> Result<Vec<u8>> {
        let encode = |bytes: &[u8]| base64::engine::general_purpose::STANDARD.encode(bytes);
        let mut content = vec![ContentPart::Text { text: &question.text }];
        content.extend(question.pictures.iter().map(|p| ContentPart::ImageUrl {
            image_url: ImageUrl { url: format!("data:{};base64,{}", p.mime, encode(&p.bytes)) },
        }));
        let request = Request {
            model: &self.model,
            messages: [ChatMessage { role: "user", content }],
            temperature: question.sampling.temperature,
            top_p: question.sampling.top_p,
            max_tokens: question.sampling.max_tokens,
        };
        serde_json::to_vec(&request).map_err(|e| Error::Vlm(format!("a question cannot be written as JSON: {e}")))
    }

    /// One HTTP request.
    fn send(&self, body: &[u8]) -> std::result::Result<String, RequestFault> {
        let mut request = self.agent.post(self.endpoint.as_str()).header("content-type", "application/json");
        if let Some(key) = &self.key {
            request = request.header("authorization", key.header.clone());
        }
        let mut response = request.send(body).map_err(|e| self.transport(&e))?;
        let status = response.status().as_u16();
        let header = |name: &str| response.headers().get(name).and_then(|v| v.to_str().ok()).map(str::to_owned);
        let pause = header("retry-after")
            .and_then(|s| s.trim().parse::<f64>().ok())
            .and_then(|secs| Duration::try_from_secs_f64(secs).ok());
        let kind = header("content-type").unwrap_or_default();
        if status == 401 || status == 403 {
            // What the server says may quote the key.
            return Err(RequestFault::Fatal(match &self.key {
                Some(key) => format!(
                    "{} refuses the key (HTTP {status}); is the one in {} valid, and for this server?",
                    self.endpoint, key.variable
                ),
                None => format!(
                    "{} wants a key (HTTP {status}); name the environment variable that holds it with --vlm-key-env",
                    self.endpoint
                ),
            }));
        }
        if status == 408 || status == 425 || status == 429 || status >= 500 {
            return Err(RequestFault::Passing(format!("HTTP {status}"), pause));
        }
        if (300..400).contains(&status) {
            return Err(RequestFault::Final(format!("HTTP {status}: a redirect; give the address that it leads to")));
        }
        let bytes =
            response.body_mut().with_config().limit(MAX_ANSWER_BYTES).read_to_vec().map_err(|e| self.transport(&e))?;
        let text = String::from_utf8_lossy(&bytes);
        if (200..300).contains(&status) {
            self.answer(&text, &kind)
        } else {
            Err(RequestFault::Final(format!("HTTP {status}{}", self.quoted(&complaint(&text)))))
        }
    }

    /// The answer in a reply. Some servers send it as text/plain: what it is counts, not what it is called.
    fn answer(&self, text: &str, kind: &str) -> std::result::Result<String, RequestFault> {
        let Ok(reply) = serde_json::from_str::<Reply>(text) else {
            let kind = kind.split(';').next().unwrap_or_default().trim();
            let hint = if kind == "text/html" { " (a web page: is the address right?)" } else { "" };
            return Err(RequestFault::Final(format!("a reply that is no JSON of a chat completion{hint}")));
        };
        let Some(choice) = reply.choices.into_iter().next() else {
            return Err(RequestFault::Final(format!("a reply without an answer{}", self.quoted(&complaint(text)))));
        };
        let content = match choice.message.content {
            Some(Content::Text(text)) => text,
            Some(Content::Parts(parts)) => parts.into_iter().map(|p| p.text).collect::<Vec<_>>().join(" "),
            None => String::new(),
        };
        let content = content.trim();
        if content.is_empty() {
            let cut = choice.finish_reason.as_deref() == Some("length");
            let hint = if cut { " (cut off before it began: raise reasoning.vlm_max_tokens)" } else { "" };
            return Err(RequestFault::Final(format!("an empty answer{hint}")));
        }
        Ok(self.redacted(content))
    }

    fn transport(&self, error: &ureq::Error) -> RequestFault {
        match error {
            ureq::Error::Timeout(_) => {
                RequestFault::Passing(format!("no answer within {} s", self.limits.request.as_secs_f64()), None)
            }
            ureq::Error::Io(e) => RequestFault::Passing(format!("connection: {}", e.kind()), None),
            ureq::Error::HostNotFound => RequestFault::Passing("no such host".to_owned(), None),
            ureq::Error::ConnectionFailed => RequestFault::Passing("no connection".to_owned(), None),
            ureq::Error::Protocol(_) => RequestFault::Passing("a reply that is no HTTP".to_owned(), None),
            ureq::Error::BodyExceedsLimit(_) => RequestFault::Final("an answer above 1 MiB".to_owned()),
            other => RequestFault::Final(self.redacted(&other.to_string())),
        }
    }

    /// A server's own words in a message: short, on one line, without the key.
    fn quoted(&self, words: &str) -> String {
        const LONGEST: usize = 160;
        let line: String = words.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(LONGEST).collect();
        if line.is_empty() { line } else { format!(": \"{}\"", self.redacted(&line)) }
    }

    fn redacted(&self, text: &str) -> String {
        // "EMPTY", "ollama" and the like are no secrets, and words of answers.
        const SECRET: usize = 8;
        match &self.key {
            Some(key) if key.secret.len() >= SECRET => text.replace(&key.secret, "***"),
            _ => text.to_owned(),
        }
    }
}

impl LanguageModel for Server {
    fn ask(&self, question: &PictureQuestion) -> Result<Option<String>> {
        if self.failed_in_a_row.load(Ordering::Relaxed) >= GIVE_UP_AFTER {
            self.count().fail("the server failed several times in a row and was not asked again");
            return Ok(None);
        }
        let body = self.body(question)?;
        let mut spent = Duration::ZERO;
        let mut pause = self.limits.first_pause;
        for attempt in 1..=self.limits.tries.max(1) {
            if !self.reserve() {
                if attempt == 1 {
                    self.count().refused += 1;
                } else {
                    self.failed("no request left to try again");
                }
                return Ok(None);
            }
            if attempt == 1 {
                self.count().ask(question);
            }
            self.count().requests += 1;
            let fault = {
                let _slot = self.slots.take();
                let begin = Instant::now();
                let outcome = self.send(&body);
                spent += begin.elapsed();
                match outcome {
                    Ok(answer) => {
                        self.failed_in_a_row.store(0, Ordering::Relaxed);
                        return Ok(Some(answer));
                    }
                    Err(fault) => fault,
                }
            };
            match fault {
                RequestFault::Fatal(message) => return Err(Error::Vlm(message)),
                RequestFault::Final(reason) => {
                    self.failed(&reason);
                    return Ok(None);
                }
                RequestFault::Passing(reason, wanted) => {
                    let wait = wanted.unwrap_or(pause).max(pause);
                    if attempt == self.limits.tries.max(1) || spent.saturating_add(wait) > self.limits.patience {
                        self.failed(&reason);
                        return Ok(None);
                    }
                    std::thread::sleep(wait);
                    spent += wait;
                    pause = pause.saturating_mul(2);
                }
            }
        }
        Ok(None)
    }

    fn name(&self) -> &str {
        &self.model
    }

    fn usage(&self) -> Usage {
        self.count().clone()
    }
}

/// A bound on how many are at it at the same time.
struct Slots {
    free: Mutex<usize>,
    freed: Condvar,
}

/// A place among them, given back when dropped.
struct RequestSlot<'a>(&'a Slots);

impl Slots {
    fn take(&self) -> RequestSlot<'_> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        while *free == 0 {
            free = self.freed.wait(free).unwrap_or_else(PoisonError::into_inner);
        }
        *free -= 1;
        RequestSlot(self)
    }
}

impl Drop for RequestSlot<'_> {
    fn drop(&mut self) {
        *self.0.free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        self.0.freed.notify_one();
    }
}

/// Whether the address names this machine.
#[must_use]
pub fn is_loopback(url: &str) -> bool {
    let host = url.trim().split_once("://").map_or("", |(_, rest)| rest);
    let host = host.split('/').next().unwrap_or_default();
    let host = host
        .strip_prefix('[')
        .map_or_else(|| host.split(':').next().unwrap_or_default(), |v6| v6.split(']').next().unwrap_or_default());
    host.eq_ignore_ascii_case("localhost")
        || host.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// The full address of the chat completions below a base address.
fn endpoint(url: &str) -> Result<String> {
    let url = url.trim().trim_end_matches('/');
    let Some((scheme, rest)) = url.split_once("://") else {
        return Err(Error::Vlm("the address must begin with http:// or https://".to_owned()));
    };
    // The rest is not shown: it may hold a password.
    if rest.split('/').next().is_some_and(|host| host.contains('@')) {
        return Err(Error::Vlm(
            "no user or password in the address; put the key into an environment variable".to_owned(),
        ));
    }
    if rest.is_empty() || rest.contains(['?', '#']) || rest.contains(char::is_whitespace) {
        return Err(Error::Vlm("the address must be a host and a path, nothing after it".to_owned()));
    }
    let scheme = scheme.to_ascii_lowercase();
    match scheme.as_str() {
        "http" => {}
        "https" if cfg!(feature = "vlm-https") => {}
        "https" => {
            return Err(Error::Vlm(
                "https:// needs a build with the feature vlm-https (cargo build --release --features vlm-https); \
                 http:// works without it"
                    .to_owned(),
            ));
        }
        _ => return Err(Error::Vlm("the address must begin with http:// or https://".to_owned())),
    }
    let path = if rest.ends_with("/chat/completions") {
        ""
    } else if rest.ends_with("/v1") {
        "/chat/completions"
    } else {
        "/v1/chat/completions"
    };
    Ok(format!("{scheme}://{rest}{path}"))
}

/// What a server complains about, in whichever of the usual forms.
fn complaint(text: &str) -> String {
    let Ok(value) = serde_json::from_str::<serde_json::Value>(text) else { return String::new() };
    ["/error/message", "/error", "/message", "/detail"]
        .iter()
        .find_map(|path| value.pointer(path).and_then(serde_json::Value::as_str))
        .unwrap_or_default()
        .to_owned()
}

#[derive(Serialize)]
struct Request<'a> {
    model: &'a str,
    messages: [ChatMessage<'a>; 1],
    temperature: f64,
    top_p: f64,
    max_tokens: usize,
}

#[derive(Serialize)]
struct ChatMessage<'a> {
    role: &'static str,
    content: Vec<ContentPart<'a>>,
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum ContentPart<'a> {
    Text { text: &'a str },
    ImageUrl { image_url: ImageUrl },
}

#[derive(Serialize)]
struct ImageUrl {
    url: String,
}

#[derive(Deserialize)]
struct Reply {
    #[serde(default)]
    choices: Vec<AnswerChoice>,
}

#[derive(Deserialize)]
struct AnswerChoice {
    message: Said,
    #[serde(default)]
    finish_reason: Option<String>,
}

#[derive(Deserialize)]
struct Said {
    #[serde(default)]
    content: Option<Content>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Content {
    Text(String),
    Parts(Vec<SaidPart>),
}

#[derive(Deserialize)]
struct SaidPart {
    #[serde(default)]
    text: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vlm::{EncodedPicture, Sampling};

    #[test]
    fn an_address_works_with_and_without_its_version() {
        for url in
            ["http://box:8000", "http://box:8000/", " http://box:8000/v1/ ", "http://box:8000/v1/chat/completions"]
        {
            assert_eq!(endpoint(url).unwrap(), "http://box:8000/v1/chat/completions", "{url}");
        }
        assert_eq!(endpoint("HTTP://box/a/openai").unwrap(), "http://box/a/openai/v1/chat/completions");
        for url in ["box:8000", "ftp://box", "http://", "http://box?key=1", "http://box/a b"] {
            assert!(endpoint(url).is_err(), "{url}");
        }
        let refused = endpoint("http://me:hunter22@box").unwrap_err().to_string();
        assert!(refused.contains("environment variable") && !refused.contains("hunter22"), "{refused}");
        let https = endpoint("https://box");
        if cfg!(feature = "vlm-https") {
            assert_eq!(https.unwrap(), "https://box/v1/chat/completions");
        } else {
            assert!(https.unwrap_err().to_string().contains("vlm-https"));
        }
    }

    #[test]
    fn this_machine_is_told_from_others() {
        for url in ["http://localhost:1", "http://127.0.0.1:8000/v1", "http://[::1]:8000"] {
            assert!(is_loopback(url), "{url}");
        }
        for url in ["http://localhost.evil.com", "http://10.0.0.1", "http://[fe80::1]", "nothing"] {
            assert!(!is_loopback(url), "{url}");
        }
    }

    #[test]
    fn a_key_shows_nowhere() {
        let key = ApiKey::new("MY_KEY", "sk-abcdefgh12345").unwrap();
        let server = Server::new("http://localhost:1", "m", Some(key.clone()), RequestLimits::default()).unwrap();
        let shown = format!("{key:?} {server:?} {}", server.quoted("wrong key\nsk-abcdefgh12345"));
        assert!(shown.contains("MY_KEY") && shown.contains("***") && !shown.contains("abcdefgh"), "{shown}");
        assert!(ApiKey::new("MY_KEY", "a\nb").unwrap_err().to_string().contains("MY_KEY"));
    }

    #[test]
    fn replies_are_read_in_every_usual_form() {
        let server = Server::new("http://localhost:1", "m", None, RequestLimits::default()).unwrap();
        let check = |text: &str| match server.answer(text, "text/html; charset=utf-8") {
            Ok(answer) => answer,
            Err(RequestFault::Final(reason)) => format!("final: {reason}"),
            Err(_) => "another fault".to_owned(),
        };
        assert_eq!(check(r#"{"choices":[{"message":{"role":"assistant","content":" drawer "}}]}"#), "drawer");
        assert_eq!(check(r#"{"choices":[{"message":{"content":[{"type":"text","text":"a"},{"type":"x"}]}}]}"#), "a");
        for (text, word) in [
            (r#"{"choices":[{"message":{"content":null},"finish_reason":"length"}]}"#, "vlm_max_tokens"),
            (r#"{"choices":[]}"#, "without an answer"),
            (r#"{"error":{"message":"no such model"}}"#, "no such model"),
            ("<html>", "is the address right"),
            ("", "no JSON"),
            (r#"{"choices":[{"message":{"content":"a"#, "no JSON"),
        ] {
            assert!(check(text).contains(word), "{text}: {}", check(text));
        }
    }

    #[test]
    fn a_question_goes_out_as_text_and_data_urls() {
        let server = Server::new("http://localhost:1", "m", None, RequestLimits::default()).unwrap();
        let question = PictureQuestion {
            purpose: "c/q".to_owned(),
            text: "which?".to_owned(),
            pictures: vec![EncodedPicture { bytes: vec![1, 2, 3], mime: "image/jpeg", size: [1, 1] }],
            sampling: Sampling { temperature: 0.5, top_p: 0.3, max_tokens: 300 },
        };
        let body: serde_json::Value = serde_json::from_slice(&server.body(&question).unwrap()).unwrap();
        let expected = serde_json::json!({
            "model": "m", "temperature": 0.5, "top_p": 0.3, "max_tokens": 300,
            "messages": [{"role": "user", "content": [
                {"type": "text", "text": "which?"},
                {"type": "image_url", "image_url": {"url": "data:image/jpeg;base64,AQID"}},
            ]}],
        });
        assert_eq!(body, expected);
    }
}

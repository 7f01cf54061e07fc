//! A client for tests: starts `choreo lsp` and implements the protocol independently of the server's code.
#![allow(dead_code)]

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// How long an answer may take on a busy machine before the test fails.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(120);

pub(crate) struct Editor {
    child: Child,
    pub input: Option<ChildStdin>,
    messages: Receiver<Value>,
    next_id: i64,
    /// Messages that arrived while the test waited for another one.
    unread_messages: Vec<Value>,
    /// Last diagnostics by URI, with the version.
    pub diagnostics: BTreeMap<String, (i64, Vec<Value>)>,
    texts: BTreeMap<String, (i64, String)>,
}

pub(crate) fn uri(path: &Path) -> String {
    format!("file://{}", path.display().to_string().replace(' ', "%20"))
}

impl Editor {
    /// A server for a folder, before `initialize`.
    pub(crate) fn uninitialized(folder: &Path) -> Editor {
        Editor::with_program(Path::new(env!("CARGO_BIN_EXE_choreo")), folder)
    }

    /// The server of a program.
    pub(crate) fn with_program(program: &Path, folder: &Path) -> Editor {
        let mut child = Command::new(program)
            .args(["lsp", "--stdio"])
            .current_dir(folder)
            .env("CHOREO_PLUGINS", "")
            // This variable makes `view` build the viewer.
            .env_remove("CARGO")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let (send, messages) = channel();
        std::thread::spawn(move || {
            while let Some(message) = read_message(&mut output) {
                if send.send(message).is_err() {
                    return;
                }
            }
        });
        let input = child.stdin.take();
        Editor {
            child,
            input,
            messages,
            next_id: 0,
            unread_messages: Vec::new(),
            diagnostics: BTreeMap::new(),
            texts: BTreeMap::new(),
        }
    }

    pub(crate) fn start(folder: &Path) -> Editor {
        Editor::initialize(Editor::uninitialized(folder), folder, json!({}))
    }

    /// Initializes a session with capabilities in addition to those for text documents.
    pub(crate) fn initialize(mut editor: Editor, folder: &Path, mut capabilities: Value) -> Editor {
        capabilities["textDocument"] =
            json!({ "completion": { "completionItem": { "snippetSupport": true } } });
        let parameters = json!({ "processId": null, "rootUri": uri(folder), "capabilities": capabilities });
        editor.request("initialize", parameters).unwrap();
        editor.notify("initialized", json!({}));
        editor
    }

    pub(crate) fn send(&mut self, message: &Value) {
        let body = message.to_string();
        self.write(format!("Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
    }

    pub(crate) fn write(&mut self, bytes: &[u8]) {
        let input = self.input.as_mut().unwrap();
        input.write_all(bytes).unwrap();
        input.flush().unwrap();
    }

    pub(crate) fn notify(&mut self, method: &str, parameters: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": parameters }));
    }

    /// Sends a request and returns its id.
    pub(crate) fn send_request(&mut self, method: &str, parameters: Value) -> i64 {
        self.next_id += 1;
        let id = self.next_id;
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": parameters }));
        id
    }

    /// The result of the request with this id, or the error code.
    pub(crate) fn request(&mut self, method: &str, parameters: Value) -> Result<Value, i64> {
        let id = self.send_request(method, parameters);
        self.response(id)
    }

    pub(crate) fn response(&mut self, id: i64) -> Result<Value, i64> {
        let message = self.wait_for_message(|m| m["id"] == id && m.get("method").is_none());
        match message["error"]["code"].as_i64() {
            Some(code) => Err(code),
            None => Ok(message["result"].clone()),
        }
    }

    /// The next message that matches; others are kept for later.
    pub(crate) fn wait_for_message(&mut self, fits: impl Fn(&Value) -> bool) -> Value {
        if let Some(index) = self.unread_messages.iter().position(&fits) {
            return self.unread_messages.remove(index);
        }
        let end = Instant::now() + RESPONSE_TIMEOUT;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let message = self.messages.recv_timeout(left).expect("the server answers");
            self.store_diagnostics(&message);
            if fits(&message) {
                return message;
            }
            self.unread_messages.push(message);
        }
    }

    fn store_diagnostics(&mut self, message: &Value) {
        if message["method"] == "textDocument/publishDiagnostics" {
            let p = &message["params"];
            let list = p["diagnostics"].as_array().cloned().unwrap_or_default();
            let version = p["version"].as_i64().unwrap_or(-1);
            self.diagnostics.insert(p["uri"].as_str().unwrap().to_string(), (version, list));
        }
    }

    pub(crate) fn open(&mut self, uri: &str, text: &str) {
        self.texts.insert(uri.to_string(), (1, text.to_string()));
        let document = json!({ "uri": uri, "languageId": "rhai", "version": 1, "text": text });
        self.notify("textDocument/didOpen", json!({ "textDocument": document }));
    }

    /// Replaces the whole text.
    pub(crate) fn replace_text(&mut self, uri: &str, text: &str) {
        let version = self.texts[uri].0 + 1;
        self.texts.insert(uri.to_string(), (version, text.to_string()));
        self.change(uri, version, json!([{ "text": text }]));
    }

    pub(crate) fn change(&mut self, uri: &str, version: i64, changes: Value) {
        let document = json!({ "uri": uri, "version": version });
        self.notify("textDocument/didChange", json!({ "textDocument": document, "contentChanges": changes }));
    }

    /// Opens a text or replaces it, without the mark `¦`. Returns the position of the mark.
    pub(crate) fn open_marked_text(&mut self, uri: &str, marked: &str) -> Value {
        let text = marked.replacen('¦', "", 1);
        let before = &marked[..marked.find('¦').expect("a mark")];
        match self.texts.contains_key(uri) {
            true => self.replace_text(uri, &text),
            false => self.open(uri, &text),
        }
        let line = before.matches('\n').count();
        let character = before.rsplit('\n').next().unwrap().encode_utf16().count();
        json!({ "line": line, "character": character })
    }

    /// Sends a request for the marked position.
    pub(crate) fn request_at_mark(&mut self, method: &str, uri: &str, marked: &str) -> Value {
        let position = self.open_marked_text(uri, marked);
        let p = json!({ "textDocument": { "uri": uri }, "position": position });
        self.request(method, p).unwrap()
    }

    /// Items of a completion at a mark; asks again while files are being read.
    pub(crate) fn completion_items(&mut self, uri: &str, marked: &str) -> Vec<Value> {
        let end = Instant::now() + RESPONSE_TIMEOUT;
        loop {
            let list = self.request_at_mark("textDocument/completion", uri, marked);
            if list["isIncomplete"] != true || Instant::now() > end {
                return list["items"].as_array().unwrap().clone();
            }
        }
    }

    pub(crate) fn completion_labels(&mut self, uri: &str, marked: &str) -> Vec<String> {
        self.completion_items(uri, marked)
            .iter()
            .map(|item| item["label"].as_str().unwrap().to_string())
            .collect()
    }

    /// The text of a hover at a mark.
    pub(crate) fn hover_text(&mut self, uri: &str, marked: &str) -> String {
        let end = Instant::now() + RESPONSE_TIMEOUT;
        loop {
            let value = self.request_at_mark("textDocument/hover", uri, marked);
            let text = value["contents"]["value"].as_str().unwrap_or_default().to_string();
            if !text.contains("is being read") || Instant::now() > end {
                return text;
            }
        }
    }

    /// Diagnostics of the latest text of a file.
    pub(crate) fn wait_for_diagnostics(&mut self, uri: &str) -> Vec<Value> {
        let version = self.texts.get(uri).map_or(-1, |(version, _)| *version);
        if let Some((_, list)) = self.diagnostics.get(uri).filter(|(known, _)| *known == version) {
            return list.clone();
        }
        let of = uri.to_string();
        let fits = move |m: &Value| {
            m["method"] == "textDocument/publishDiagnostics"
                && m["params"]["uri"] == of.as_str()
                && m["params"]["version"] == version
        };
        self.wait_for_message(fits);
        self.diagnostics[uri].1.clone()
    }

    /// Sends a request for a whole document.
    pub(crate) fn request_about_document(&mut self, method: &str, uri: &str) -> Value {
        self.request(method, json!({ "textDocument": { "uri": uri } })).unwrap()
    }

    /// Runs a command of the server: its result, or the error's code and message.
    pub(crate) fn execute(&mut self, command: &str, argument: Value) -> Result<Value, (i64, String)> {
        let id = self
            .send_request("workspace/executeCommand", json!({ "command": command, "arguments": [argument] }));
        let message = self.wait_for_message(|m| m["id"] == id && m.get("method").is_none());
        match message["error"]["code"].as_i64() {
            Some(code) => Err((code, message["error"]["message"].as_str().unwrap().to_string())),
            None => Ok(message["result"].clone()),
        }
    }

    /// Shuts the server down as the protocol requires, and returns its exit code.
    pub(crate) fn shut_down(mut self) -> i32 {
        self.request("shutdown", Value::Null).unwrap();
        self.notify("exit", Value::Null);
        self.wait_for_exit()
    }

    /// Waits until the server exits.
    pub(crate) fn wait_for_exit(mut self) -> i32 {
        drop(self.input.take());
        self.child.wait().unwrap().code().unwrap_or(-1)
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        drop(self.input.take());
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read_message(output: &mut impl BufRead) -> Option<Value> {
    let mut length = 0;
    loop {
        let mut line = String::new();
        if output.read_line(&mut line).ok()? == 0 {
            return None;
        }
        if line == "\r\n" {
            break;
        }
        if let Some(number) = line.strip_prefix("Content-Length: ") {
            length = number.trim().parse().ok()?;
        }
    }
    let mut body = vec![0; length];
    output.read_exact(&mut body).ok()?;
    serde_json::from_slice(&body).ok()
}

//! The server: processes messages in order, answers requests, and forwards the findings of the checker.

use crate::checker::{CheckResult, Checker, Job, UnsavedTexts, tests_root};
use crate::commands::{self, CommandRequest, RunningCommands};
use crate::document::{Document, path_of};
use crate::files::Files;
use crate::request::Request;
use crate::settings::Settings;
use crate::transport::{Client, Received, ResponseError, receive};
use crate::values::Budget;
use crate::view::{ModuleFiles, OpenModules, View};
use crate::{
    Host, HostError, Project, actions, colors, completion, diagnostics, formatting, hints, hover, lenses,
    references, semantic, signature, symbols,
};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// How a session ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionEnd {
    /// The client sent `shutdown` and `exit`.
    Exit,
    /// The client sent `exit` without `shutdown`, or its pipe was closed.
    Abruptly,
}

enum Event {
    Client(Received),
    Checked(Box<CheckResult>),
}

/// Serves one client until it disconnects.
pub fn serve(
    mut input: impl BufRead + Send + 'static,
    output: impl Write + Send + 'static,
    host: Arc<dyn Host>,
) -> SessionEnd {
    let (events, incoming) = channel();
    let files = Files::new();
    let checked = events.clone();
    let checker = Checker::start(host.clone(), files.cache.clone(), move |found| {
        let _ = checked.send(Event::Checked(Box::new(found)));
    });
    let read = move || {
        loop {
            let received = receive(&mut input);
            let closed = received == Received::Closed;
            if events.send(Event::Client(received)).is_err() || closed {
                return;
            }
        }
    };
    if std::thread::Builder::new().name("client".into()).spawn(read).is_err() {
        return SessionEnd::Abruptly;
    }
    let server = Server {
        host,
        client: Client::new(output),
        checker,
        files: RefCell::new(files),
        modules: RefCell::default(),
        documents: BTreeMap::new(),
        projects: RefCell::default(),
        last_results: BTreeMap::new(),
        published_diagnostics: BTreeMap::new(),
        root: std::env::current_dir().unwrap_or_default(),
        settings: Settings::default(),
        running: RunningCommands::default(),
        client_capabilities: ClientCapabilities::default(),
        initialized: false,
        shut_down: false,
    };
    server.run(&incoming)
}

struct Server {
    host: Arc<dyn Host>,
    client: Client,
    checker: Checker,
    files: RefCell<Files>,
    modules: RefCell<ModuleFiles>,
    /// Open documents by URI.
    documents: BTreeMap<String, Document>,
    /// Project settings by URI of the document, each with the time when it was read.
    projects: RefCell<BTreeMap<String, (Instant, Project)>>,
    /// Result of the last run of each document.
    last_results: BTreeMap<String, CheckResult>,
    /// Published diagnostics, by the URI of the script that was run, then by the URI of the file that they are about.
    published_diagnostics: BTreeMap<String, BTreeMap<String, Vec<Value>>>,
    root: PathBuf,
    settings: Settings,
    running: RunningCommands,
    client_capabilities: ClientCapabilities,
    initialized: bool,
    shut_down: bool,
}

/// Capabilities of the client.
#[derive(Clone, Copy, Debug, Default)]
struct ClientCapabilities {
    /// Supports snippets with placeholders.
    snippets: bool,
    refresh_hints: bool,
    refresh_lenses: bool,
    show_progress: bool,
}

type RequestResult = Result<Value, ResponseError>;

impl Server {
    fn run(mut self, incoming: &Receiver<Event>) -> SessionEnd {
        let mut waiting: VecDeque<Event> = VecDeque::new();
        loop {
            if waiting.is_empty() {
                match incoming.recv() {
                    Ok(event) => waiting.push_back(event),
                    Err(_) => return SessionEnd::Abruptly,
                }
            }
            // Requests that are cancelled before their turn are not processed.
            waiting.extend(incoming.try_iter());
            self.refuse_cancelled(&mut waiting);
            let Some(event) = waiting.pop_front() else { continue };
            match event {
                Event::Checked(checked) => self.publish_result(*checked),
                Event::Client(Received::Closed) => return SessionEnd::Abruptly,
                Event::Client(Received::Invalid(why)) => {
                    self.client.send_error(&Value::Null, &ResponseError::new(ResponseError::PARSE, why));
                }
                Event::Client(Received::Message(message)) => {
                    if message["method"] == "exit" {
                        return if self.shut_down { SessionEnd::Exit } else { SessionEnd::Abruptly };
                    }
                    self.handle_message(&message);
                }
            }
        }
    }

    fn refuse_cancelled(&self, waiting: &mut VecDeque<Event>) {
        let message = |event: &Event| match event {
            Event::Client(Received::Message(message)) => Some(message.clone()),
            _ => None,
        };
        let cancels: Vec<Value> = waiting
            .iter()
            .filter_map(message)
            .filter(|message| message["method"] == "$/cancelRequest")
            .map(|message| message["params"]["id"].clone())
            .collect();
        if cancels.is_empty() {
            return;
        }
        waiting.retain(|event| {
            let Some(message) = message(event) else { return true };
            let id = &message["id"];
            let cancelled = !id.is_null() && message["method"].is_string() && cancels.contains(id);
            if cancelled {
                let error = ResponseError::new(ResponseError::CANCELLED, "the request was cancelled");
                self.client.send_error(id, &error);
            }
            !cancelled
        });
    }

    /// Processes a request or notification. A panic becomes the error of its request, and the server continues.
    fn handle_message(&mut self, message: &Value) {
        let id = message.get("id").cloned();
        let Some(method) = message["method"].as_str() else {
            // The message is the response to a request of the server, or invalid.
            if let Some(id) = id.filter(|_| message.get("result").is_none() && message.get("error").is_none())
            {
                self.client
                    .send_error(&id, &ResponseError::new(ResponseError::INVALID, "a message has no method"));
            }
            return;
        };
        let parameters = &message["params"];
        let answer = catch_unwind(AssertUnwindSafe(|| match &id {
            // The response is sent when the command has ended.
            Some(id) if method == "workspace/executeCommand" => {
                self.execute_command(id, parameters).map(|()| None)
            }
            Some(_) => self.handle_request(method, parameters).map(Some),
            None => {
                self.handle_notification(method, parameters);
                Ok(None)
            }
        }));
        let answer = answer.unwrap_or_else(|_| {
            Err(ResponseError::new(
                ResponseError::INTERNAL,
                format!("the program itself failed on {method}; please report it"),
            ))
        });
        match (id, answer) {
            (Some(id), Ok(Some(result))) => self.client.send_result(&id, result),
            (Some(id), Err(error)) => self.client.send_error(&id, &error),
            (_, Ok(None)) | (None, _) => {}
        }
    }

    fn handle_request(&mut self, method: &str, p: &Value) -> RequestResult {
        match method {
            "initialize" => return Ok(self.initialize(p)),
            _ if !self.initialized => {
                return Err(ResponseError::new(
                    ResponseError::NOT_INITIALIZED,
                    "the first request must be initialize",
                ));
            }
            "shutdown" => {
                self.shut_down = true;
                return Ok(Value::Null);
            }
            "textDocument/colorPresentation" => return Ok(colors::presentations(&p["color"])),
            _ => {}
        }
        let known = METHODS.iter().find(|(name, _)| *name == method);
        let Some((_, answer)) = known else {
            return Err(ResponseError::new(ResponseError::UNKNOWN, format!("{method} is not supported")));
        };
        let uri = p["textDocument"]["uri"].as_str().unwrap_or_default();
        let Some(document) = self.documents.get(uri) else {
            return Err(ResponseError::new(ResponseError::PARAMETERS, format!("{uri} is not open")));
        };
        let project = self
            .project(document)
            .map_err(|why| ResponseError::new(ResponseError::FAILED, why.to_string()))?;
        let folder = document.folder().unwrap_or(&self.root);
        let tests_root = self.tests_root(document, &project);
        let modules = self.modules(folder, tests_root.as_deref());
        let last = self.last_results.get(uri);
        let stage = last.and_then(|checked| checked.stage.as_ref());
        let view = View {
            source: &document.source,
            project: &project,
            folder: Some(folder),
            tests_root: tests_root.as_deref(),
            files: &self.files,
            modules: &modules,
            budget: Budget::default(),
            fps: stage.map_or(30.0, |(stage, _)| stage.settings.fps.as_fps()),
            snippets: self.client_capabilities.snippets,
        };
        answer(&Request { view: &view, uri, parameters: p, last, settings: &self.settings })
    }

    fn modules<'m>(&'m self, folder: &'m Path, tests_root: Option<&'m Path>) -> OpenModules<'m> {
        OpenModules { documents: &self.documents, folder: Some(folder), tests_root, cache: &self.modules }
    }

    /// Folder that a document with tests may read completely.
    fn tests_root(&self, document: &Document, project: &Project) -> Option<PathBuf> {
        let untitled = self.root.join("untitled.rhai");
        let script = document.path.as_deref().unwrap_or(&untitled);
        document.source.has_tests().then(|| tests_root(script, &self.root, project)).flatten()
    }

    /// Starts a command. Its first argument names the file: `{ uri, line?, time?, section?, silent? }`.
    fn execute_command(&mut self, id: &Value, p: &Value) -> Result<(), ResponseError> {
        let wrong = |why: &str| ResponseError::new(ResponseError::PARAMETERS, why);
        if !self.initialized {
            return Err(ResponseError::new(
                ResponseError::NOT_INITIALIZED,
                "the first request must be initialize",
            ));
        }
        let name = p["command"].as_str().unwrap_or_default().to_string();
        if !commands::NAMES.contains(&&*name) {
            let known = commands::NAMES.join(", ");
            return Err(wrong(&format!("the command \"{name}\" does not exist; the commands are {known}")));
        }
        let argument = &p["arguments"][0];
        let uri = argument["uri"].as_str().unwrap_or_default();
        let script = path_of(uri).filter(|path| path.is_file());
        let script = script
            .ok_or_else(|| wrong("the first argument needs a field uri: the file: URI of a saved script"))?;
        let mut secs = argument["time"].as_f64().unwrap_or(0.0);
        if let Some(document) = self.documents.get(uri) {
            let text = std::fs::read_to_string(&script).unwrap_or_default();
            if text.trim_start_matches('\u{feff}') != document.source.text.trim_start_matches('\u{feff}') {
                let name = script.file_name().unwrap_or_default().to_string_lossy();
                return Err(ResponseError::new(ResponseError::FAILED, format!("save {name} first")));
            }
            if let (None, Some(line)) = (argument["time"].as_f64(), argument["line"].as_u64()) {
                secs = lenses::time_of_line(&document.source, self.last_results.get(uri), line as usize);
            }
        }
        let mut progress = p.get("workDoneToken").cloned();
        if progress.is_none() && self.client_capabilities.show_progress {
            let token = json!(format!("command {id}"));
            self.client.send_request("window/workDoneProgress/create", json!({ "token": token }));
            progress = Some(token);
        }
        let request = CommandRequest {
            id: id.clone(),
            name,
            script,
            secs,
            section: argument["section"].as_str().map(str::to_string),
            root: self.root.clone(),
            is_silent: argument["silent"] == true,
            progress,
        };
        self.running.start(request, &*self.host, self.client.clone())
    }

    fn initialize(&mut self, p: &Value) -> Value {
        self.initialized = true;
        let capabilities = &p["capabilities"];
        self.client_capabilities = ClientCapabilities {
            snippets: capabilities["textDocument"]["completion"]["completionItem"]["snippetSupport"] == true,
            refresh_hints: capabilities["workspace"]["inlayHint"]["refreshSupport"] == true,
            refresh_lenses: capabilities["workspace"]["codeLens"]["refreshSupport"] == true,
            show_progress: capabilities["window"]["workDoneProgress"] == true,
        };
        self.settings.update(&p["initializationOptions"]);
        let root = p["workspaceFolders"][0]["uri"].as_str().or_else(|| p["rootUri"].as_str());
        self.root = root.and_then(path_of).unwrap_or_else(|| self.root.clone());
        let (name, version) = self.host.program();
        json!({
            "serverInfo": { "name": name, "version": version },
            "capabilities": {
                "positionEncoding": "utf-16",
                "textDocumentSync": { "openClose": true, "change": 2 },
                "completionProvider": { "triggerCharacters": [".", "\"", ":", "{", "(", ",", "/", " "] },
                "hoverProvider": true,
                "signatureHelpProvider": { "triggerCharacters": ["(", ","], "retriggerCharacters": [","] },
                "codeActionProvider": { "codeActionKinds": ["quickfix"] },
                "colorProvider": true,
                "definitionProvider": true,
                "referencesProvider": true,
                "renameProvider": { "prepareProvider": true },
                "documentSymbolProvider": true,
                "foldingRangeProvider": true,
                "inlayHintProvider": true,
                "semanticTokensProvider": { "legend": semantic::legend(), "full": true, "range": true },
                "documentFormattingProvider": true,
                "documentRangeFormattingProvider": true,
                "codeLensProvider": {},
                "executeCommandProvider": { "commands": commands::NAMES, "workDoneProgress": true },
            },
        })
    }

    fn handle_notification(&mut self, method: &str, p: &Value) {
        let document = &p["textDocument"];
        let uri = document["uri"].as_str().unwrap_or_default().to_string();
        let version = document["version"].as_i64().unwrap_or(0);
        match method {
            "textDocument/didOpen" => {
                let text = document["text"].as_str().unwrap_or_default();
                self.documents.insert(uri.clone(), Document::new(&uri, version, text));
                self.check_with_dependents(&uri);
            }
            "textDocument/didChange" => {
                let changes = p["contentChanges"].as_array().cloned().unwrap_or_default();
                if let Some(document) = self.documents.get_mut(&uri) {
                    document.apply_changes(version, &changes);
                    self.check_with_dependents(&uri);
                }
            }
            "textDocument/didSave" | "workspace/didChangeWatchedFiles" => {
                // A model or choreo.toml may have changed.
                self.projects.borrow_mut().clear();
                self.documents
                    .keys()
                    .cloned()
                    .collect::<Vec<_>>()
                    .iter()
                    .for_each(|uri| self.submit_for_check(uri));
            }
            "workspace/didChangeConfiguration" => {
                self.settings.update(&p["settings"]["choreo"]);
                self.refresh_hints_and_lenses();
            }
            "$/cancelRequest" => self.running.cancel(&p["id"]),
            "window/workDoneProgress/cancel" => self.running.cancel(&p["token"]),
            "textDocument/didClose" => {
                self.documents.remove(&uri);
                self.last_results.remove(&uri);
                let removed = self.published_diagnostics.remove(&uri).unwrap_or_default();
                removed.keys().for_each(|target| self.publish(target));
            }
            _ => {}
        }
    }

    /// Submits a script and the open scripts that import it to the checker.
    fn check_with_dependents(&mut self, uri: &str) {
        let path = self.documents.get(uri).and_then(|document| document.path.clone());
        let is_dependent = |checked: &&CheckResult| {
            checked.uri != uri && path.as_ref().is_some_and(|p| checked.read_files.contains(p))
        };
        let dependents: Vec<String> =
            self.last_results.values().filter(is_dependent).map(|checked| checked.uri.clone()).collect();
        // The checker runs the script first that is submitted last.
        dependents.iter().for_each(|uri| self.submit_for_check(uri));
        self.submit_for_check(uri);
    }

    fn submit_for_check(&self, uri: &str) {
        let Some(document) = self.documents.get(uri) else { return };
        let texts = self.documents.values().filter_map(|d| Some((d.path.clone()?, d.source.text.clone())));
        let unsaved_texts: UnsavedTexts = Arc::new(texts.collect());
        self.checker.submit(Job {
            uri: uri.to_string(),
            version: document.version,
            path: document.path.clone(),
            text: document.source.text.clone(),
            unsaved_texts,
            folder: self.root.clone(),
        });
    }

    /// Publishes the findings of a run, unless the text has changed since.
    fn publish_result(&mut self, mut checked: CheckResult) {
        let uri = checked.uri.clone();
        let Some(document) = self.documents.get(&uri).filter(|document| document.version == checked.version)
        else {
            return;
        };
        let folder = document.folder().unwrap_or(&self.root);
        let modules = self.modules(folder, None);
        let new = diagnostics::diagnostics_by_uri(&checked, &document.source, document.folder(), &modules);
        let old = self.published_diagnostics.insert(uri.clone(), new).unwrap_or_default();
        let mut targets: Vec<String> = old.into_keys().collect();
        targets.extend(self.published_diagnostics.get(&uri).into_iter().flat_map(|new| new.keys().cloned()));
        targets.sort();
        targets.dedup();
        targets.iter().for_each(|target| self.publish(target));
        // While the script has errors, the last valid stage is kept.
        let is_new = checked.stage.is_some();
        if let Some(before) = self.last_results.remove(&uri).filter(|_| !is_new) {
            checked.stage = before.stage;
        }
        self.last_results.insert(uri, checked);
        if is_new {
            self.refresh_hints_and_lenses();
        }
    }

    /// Asks the client to request everything again that depends on the last run.
    fn refresh_hints_and_lenses(&self) {
        if self.client_capabilities.refresh_hints {
            self.client.send_request("workspace/inlayHint/refresh", Value::Null);
        }
        if self.client_capabilities.refresh_lenses {
            self.client.send_request("workspace/codeLens/refresh", Value::Null);
        }
    }

    /// Publishes all messages about a file. Messages about a module are sent once, even if several scripts import it.
    fn publish(&self, target: &str) {
        let mut all: Vec<&Value> = Vec::new();
        for message in
            self.published_diagnostics.values().filter_map(|of_script| of_script.get(target)).flatten()
        {
            let same =
                |known: &&Value| known["range"] == message["range"] && known["message"] == message["message"];
            if !all.iter().any(same) {
                all.push(message);
            }
        }
        let mut parameters = json!({ "uri": target, "diagnostics": all });
        if let Some(document) = self.documents.get(target) {
            parameters["version"] = document.version.into();
        }
        self.client.notify("textDocument/publishDiagnostics", parameters);
    }

    /// Project settings of a document, reused for a short time.
    fn project(&self, document: &Document) -> Result<Project, HostError> {
        /// Time for which settings are reused.
        const SETTINGS_LIFETIME: Duration = Duration::from_secs(2);
        if let Some((_, known)) =
            self.projects.borrow().get(&document.uri).filter(|(at, _)| at.elapsed() < SETTINGS_LIFETIME)
        {
            return Ok(known.clone());
        }
        let untitled = self.root.join("untitled.rhai");
        let project = self.host.project(document.path.as_deref().unwrap_or(&untitled))?;
        self.projects.borrow_mut().insert(document.uri.clone(), (Instant::now(), project.clone()));
        Ok(project)
    }
}

type RequestHandler = fn(&Request) -> RequestResult;

/// Requests about a document, by method.
const METHODS: &[(&str, RequestHandler)] = &[
    ("textDocument/completion", |r| Ok(completion::complete(r.view, r.byte()))),
    ("textDocument/hover", |r| Ok(hover::hover(r.view, r.byte()))),
    ("textDocument/signatureHelp", |r| Ok(signature::signature(r.view, r.byte()))),
    ("textDocument/definition", references::definition),
    ("textDocument/references", references::references),
    ("textDocument/prepareRename", references::prepare_rename),
    ("textDocument/rename", references::rename),
    ("textDocument/documentSymbol", |r| Ok(symbols::symbols(r.view))),
    ("textDocument/foldingRange", |r| Ok(symbols::folding_ranges(r.view))),
    ("textDocument/documentColor", |r| Ok(colors::colors(r.view))),
    ("textDocument/inlayHint", |r| Ok(hints::hints(r.view, r.settings, r.last, &r.parameters["range"]))),
    ("textDocument/semanticTokens/full", |r| Ok(semantic::semantic_tokens(r.view, None))),
    ("textDocument/semanticTokens/range", |r| {
        Ok(semantic::semantic_tokens(r.view, Some(&r.parameters["range"])))
    }),
    ("textDocument/formatting", |r| Ok(formatting::formatting(r.view, None))),
    ("textDocument/rangeFormatting", |r| Ok(formatting::formatting(r.view, Some(&r.parameters["range"])))),
    ("textDocument/codeLens", |r| match r.settings.code_lenses {
        true => Ok(lenses::lenses(r.view, r.uri, r.last)),
        false => Ok(json!([])),
    }),
    ("textDocument/codeAction", |r| {
        let diagnostics = r.parameters["context"]["diagnostics"].as_array().cloned().unwrap_or_default();
        Ok(actions::actions(r.view, r.uri, &diagnostics))
    }),
];

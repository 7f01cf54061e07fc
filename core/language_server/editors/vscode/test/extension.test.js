// The extension with a stand-in for the editor, and the program itself (CHOREO) behind the test explorer.

const assert = require("node:assert");
const fs = require("node:fs");
const Module = require("node:module");
const os = require("node:os");
const path = require("node:path");
const test = require("node:test");

const events = { commands: {}, executed: [], runs: [], clients: [] };
const listeners = {};
const listen = (name) => (listener) => {
  listeners[name] = listener;
  return { dispose() {} };
};

class Items extends Map {
  add(item) {
    this.set(item.id, item);
  }
  replace(items) {
    this.clear();
    items.forEach((item) => this.add(item));
  }
  forEach(visit) {
    [...this.values()].forEach((item) => visit(item));
  }
}

class Uri {
  constructor(fsPath) {
    this.fsPath = fsPath;
  }
  toString() {
    return `file://${this.fsPath}`;
  }
  static file(fsPath) {
    return new Uri(fsPath);
  }
  static parse(text) {
    return new Uri(text.replace(/^file:\/\//, ""));
  }
}

const results = (run, kind) => (item, messages) => run.push([kind, item.label, [messages].flat().map((m) => m?.message)]);
const vscode = {
  Uri,
  Range: class {},
  Position: class {
    constructor(line, character) {
      Object.assign(this, { line, character });
    }
  },
  Location: class {
    constructor(uri, position) {
      Object.assign(this, { uri, position });
    }
  },
  TestMessage: class {
    constructor(message) {
      this.message = message;
    }
  },
  TestRunProfileKind: { Run: 1 },
  ViewColumn: { Beside: -2 },
  commands: {
    registerCommand: (name, run) => (events.commands[name] = run) && { dispose() {} },
    executeCommand: async (...args) => void events.executed.push(args),
  },
  window: { activeTextEditor: undefined },
  workspace: {
    textDocuments: [],
    getConfiguration: () => ({ get: () => process.env.CHOREO, inlayHints: { cueTimes: false }, codeLenses: true }),
    createFileSystemWatcher: () => ({ dispose() {} }),
    onDidChangeConfiguration: listen("configuration"),
    onDidSaveTextDocument: listen("saved"),
    getWorkspaceFolder: () => vscode.workspace.workspaceFolders[0],
  },
  tests: {
    createTestController() {
      const controller = {
        items: new Items(),
        createTestItem: (id, label, uri) => ({ id, label, uri, children: new Items() }),
        createRunProfile: (_label, _kind, run) => (events.start = run),
        createTestRun() {
          const run = [];
          events.runs.push(run);
          const kinds = ["enqueued", "started", "passed", "failed", "errored", "skipped"];
          const all = Object.fromEntries(kinds.map((kind) => [kind, results(run, kind)]));
          return { ...all, appendOutput() {}, end: () => run.push(["end"]) };
        },
        dispose() {},
      };
      events.controller = controller;
      return controller;
    },
  },
};

class LanguageClient {
  constructor(id, name, server, options) {
    Object.assign(this, { id, name, server, options, running: false });
    events.clients.push(this);
  }
  async start() {
    this.running = true;
  }
  needsStop() {
    return this.running;
  }
  async stop() {
    this.running = false;
  }
}

const load = Module._load;
Module._load = (name, ...rest) => {
  if (name === "vscode") return vscode;
  if (name === "vscode-languageclient/node") return { LanguageClient };
  return load(name, ...rest);
};
const extension = require("../extension");

const folder = fs.mkdtempSync(path.join(os.tmpdir(), "choreo-vscode-"));
process.on("exit", () => fs.rmSync(folder, { recursive: true, force: true }));
fs.writeFileSync(
  path.join(folder, "sums.rhai"),
  'test("holds", || { expect(1).equals(1); });\ntest("fails", || {\n    expect(1).equals(2);\n});\n',
);
vscode.workspace.workspaceFolders = [{ uri: Uri.file(folder) }];
const context = { subscriptions: [] };
const never = { isCancellationRequested: false, onCancellationRequested() {} };

test("the client starts the server with the settings", async () => {
  await extension.activate(context);
  const [client] = events.clients;
  assert.deepStrictEqual(client.server, { command: process.env.CHOREO, args: ["lsp"] });
  assert.deepStrictEqual(client.options.initializationOptions, { inlayHints: { cueTimes: false }, codeLenses: true });
  await listeners.configuration({ affectsConfiguration: (name) => name === "choreo.path" });
  assert.deepStrictEqual(events.clients.map((client) => client.running), [false, true]);
});

test("a frame is rendered from the saved script and shown beside it", async () => {
  const script = Uri.file(path.join(folder, "sums.rhai"));
  let saved = 0;
  const document = { uri: script, languageId: "rhai", isDirty: true, save: async () => void saved++ };
  vscode.workspace.textDocuments = [document];
  vscode.window.activeTextEditor = { document, selection: { active: { line: 7 } } };
  await events.commands["choreo.renderFrameHere"]();
  assert.deepStrictEqual(events.executed.pop(), ["choreo.renderFrame", { uri: script.toString(), line: 7 }]);
  const asked = [];
  const next = async (...args) => asked.push(args) && { path: "/tmp/frame.png" };
  await events.clients[1].options.middleware.executeCommand("choreo.renderFrame", [{ uri: script.toString(), line: 7 }], next);
  assert.deepStrictEqual(asked, [["choreo.renderFrame", [{ uri: script.toString(), line: 7, silent: true }]]]);
  const [command, uri] = events.executed.pop();
  assert.deepStrictEqual([saved, command, uri.fsPath], [1, "vscode.open", "/tmp/frame.png"]);
});

test("the test explorer finds and runs tests", async () => {
  await events.controller.resolveHandler();
  const [file] = events.controller.items.values();
  assert.deepStrictEqual([file.label, ...[...file.children.values()].map((item) => item.label)], ["sums.rhai", "holds", "fails"]);
  await events.start({}, never);
  const results = events.runs[0].filter(([kind]) => !["enqueued", "started"].includes(kind));
  assert.deepStrictEqual(results.map(([kind, label]) => [kind, label]), [["passed", "holds"], ["failed", "fails"], ["end", undefined]]);
  assert.match(results[1][2][0], /expected[^]*2/);
  await events.start({ include: [[...file.children.values()][1]] }, never);
  assert.deepStrictEqual(events.runs[1].map(([kind]) => kind), ["enqueued", "started", "failed", "end"]);

  // Another test after a save.
  fs.appendFileSync(path.join(folder, "sums.rhai"), 'test("new", || { expect(1).equals(1); });\n');
  await listeners.saved({ uri: file.uri, languageId: "rhai", getText: () => "test(" });
  const [again] = events.controller.items.values();
  assert.deepStrictEqual([...again.children.values()].map((item) => item.label), ["holds", "fails", "new"]);
});

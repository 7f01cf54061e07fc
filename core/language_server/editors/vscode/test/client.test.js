// The extension with its real client library and the program itself (CHOREO); only the editor is a stand-in, which answers what the
// library asks and notes what it registers.

const assert = require("node:assert");
const fs = require("node:fs");
const Module = require("node:module");
const os = require("node:os");
const path = require("node:path");
const test = require("node:test");

const commands = {};
const providers = new Set();
const opened = [];
const errors = [];

const disposable = () => ({ dispose() {} });
const event = () => disposable();
// Anything that is asked for and not stated below.
const anything = new Proxy(function () {}, {
  get: (_, name) => (name === "then" ? undefined : name === Symbol.toPrimitive ? () => "" : anything),
  apply: () => anything,
  construct: () => ({}),
});
const or = (stated, other) => new Proxy(stated, { get: (target, name) => (name in target ? target[name] : other(String(name))) });
const codeActionKind = (value) => ({ value, append: (part) => codeActionKind(`${value}.${part}`) });

class Uri {
  constructor(fsPath) {
    Object.assign(this, { fsPath, path: fsPath, scheme: "file" });
  }
  toString() {
    return `file://${this.fsPath}`;
  }
  static file(fsPath) {
    return new Uri(fsPath);
  }
  static parse(text) {
    return new Uri(String(text).replace(/^file:\/\//, ""));
  }
}

class Disposable {
  dispose() {}
  static from() {
    return new Disposable();
  }
}

class EventEmitter {
  listeners = [];
  event = (listener) => this.listeners.push(listener) && disposable();
  fire(value) {
    this.listeners.forEach((listener) => listener(value));
  }
  dispose() {}
}

class CancellationTokenSource {
  token = { isCancellationRequested: false, onCancellationRequested: event };
  cancel() {}
  dispose() {}
}

const classes = {};
const vscode = or(
  {
    version: "1.82.0",
    Uri,
    EventEmitter,
    CancellationTokenSource,
    Disposable,
    CodeActionKind: or({}, codeActionKind),
    env: { appName: "stand-in", language: "en" },
    commands: {
      registerCommand: (name, run) => (commands[name] = run) && disposable(),
      executeCommand: async (name, ...args) => void opened.push([name, String(args[0])]),
    },
    languages: or(
      { createDiagnosticCollection: () => ({ ...disposable(), set() {}, delete() {}, clear() {} }) },
      (name) => () => providers.add(name.replace(/^register|Provider$/g, "")) && disposable(),
    ),
    tests: { createTestController: () => or({ dispose() {} }, () => anything) },
    window: or(
      {
        createOutputChannel: () => ({ append() {}, appendLine() {}, show() {}, dispose() {} }),
        showErrorMessage: async (message) => void errors.push(message),
        visibleTextEditors: [],
        tabGroups: { all: [], onDidChangeTabs: event, onDidChangeTabGroups: event },
        withProgress: (_, run) => run({ report() {} }, { onCancellationRequested: event }),
      },
      (name) => (name.startsWith("on") ? event : undefined),
    ),
    workspace: or(
      {
        textDocuments: [],
        notebookDocuments: [],
        workspaceFolders: undefined,
        getConfiguration: () => ({ get: (name, value) => (name === "path" ? process.env.CHOREO : value) }),
        createFileSystemWatcher: () => ({ ...disposable(), onDidCreate: event, onDidChange: event, onDidDelete: event }),
      },
      (name) => (name.startsWith("on") ? event : anything),
    ),
  },
  (name) => (/^[A-Z]/.test(name) ? (classes[name] ??= class {}) : anything),
);
const load = Module._load;
Module._load = (name, ...rest) => (name === "vscode" ? vscode : load(name, ...rest));
const extension = require("../extension");

test("the client library agrees with the server on everything, and renders a frame", { timeout: 120_000 }, async () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), "choreo-client-"));
  const script = path.join(folder, "scene.rhai");
  fs.writeFileSync(script, 'stage(#{ size: [32, 18] });\ncast("box", shape("box"));\ncamera("a").at(0, 1, 4);\n');
  await extension.activate({ subscriptions: [] });
  assert.deepStrictEqual(errors, []);
  const expected = [
    "CodeActions", "CodeLens", "Color", "CompletionItem", "Definition", "DocumentFormattingEdit",
    "DocumentRangeFormattingEdit", "DocumentRangeSemanticTokens", "DocumentSemanticTokens", "DocumentSymbol",
    "FoldingRange", "Hover", "InlayHints", "Reference", "Rename", "SignatureHelp",
  ];
  assert.deepStrictEqual([...providers].sort(), expected);
  const drawn = await commands["choreo.renderFrame"]({ uri: `file://${script}`, time: 0.5 });
  const png = fs.readFileSync(drawn.path);
  assert.deepStrictEqual([drawn.time, png.readUInt32BE(16), png.readUInt32BE(20)], [0.5, 32, 18]);
  assert.deepStrictEqual(opened, [["vscode.open", `file://${drawn.path}`]]);
  await assert.rejects(commands["choreo.renderFrame"]({ uri: `file://${folder}/none.rhai` }), /uri of a saved script/);
  await extension.deactivate();
  // The server removes its frames when it ends.
  while (fs.existsSync(drawn.path)) await new Promise((resolve) => setTimeout(resolve, 20));
  fs.rmSync(folder, { recursive: true });
});

// The tests of scripts in the test explorer. `choreo test --list --json` finds them, `choreo test --json` runs them.

const path = require("path");
const { spawn } = require("child_process");
const vscode = require("vscode");
const { grouped, listed, outcomes } = require("./report");

// What a run of the program prints in JSON; rejects with what it says if that is none.
function run(program, args, cwd, token) {
  return new Promise((resolve, reject) => {
    const child = spawn(program, args, { cwd, stdio: ["ignore", "pipe", "pipe"] });
    const out = [];
    const err = [];
    child.stdout.on("data", (data) => out.push(data));
    child.stderr.on("data", (data) => err.push(data));
    child.on("error", reject);
    token?.onCancellationRequested(() => child.kill());
    child.on("close", () => {
      try {
        resolve(JSON.parse(Buffer.concat(out).toString()));
      } catch {
        reject(new Error(Buffer.concat(err).toString().trim() || `${program} ended without a result`));
      }
    });
  });
}

class TestExplorer {
  constructor(program) {
    this.program = program;
    this.controller = vscode.tests.createTestController("choreo", "choreo");
    // The folder, file and section of each item.
    this.known = new WeakMap();
    this.controller.resolveHandler = (item) => (item ? undefined : this.find());
    this.controller.refreshHandler = () => this.find();
    const profile = vscode.TestRunProfileKind.Run;
    this.controller.createRunProfile("Run", profile, (request, token) => this.start(request, token), true);
    this.saved = vscode.workspace.onDidSaveTextDocument((document) => this.findIn(document));
  }

  dispose() {
    this.saved.dispose();
    this.controller.dispose();
  }

  async find() {
    const folders = vscode.workspace.workspaceFolders ?? [];
    this.controller.items.replace([]);
    for (const folder of folders) await this.list(folder.uri.fsPath, []);
  }

  // A file that was saved has other tests than before.
  async findIn(document) {
    const folder = vscode.workspace.getWorkspaceFolder(document.uri);
    if (document.languageId !== "rhai" || !folder) return;
    const root = folder.uri.fsPath;
    const file = path.relative(root, document.uri.fsPath).split(path.sep).join("/");
    const id = document.uri.toString();
    if (!this.controller.items.get(id) && !/\btest\s*\(/.test(document.getText())) return;
    this.controller.items.delete(id);
    await this.list(root, [file]);
  }

  async list(root, files) {
    let list;
    try {
      list = await run(this.program(), ["test", "--list", "--json", ...files], root);
    } catch {
      // A folder without scripts, or without the program, has no tests; the server says what is wrong with the program.
      return;
    }
    for (const { file, errors, sections } of listed(list)) {
      const uri = vscode.Uri.file(path.join(root, file));
      const item = this.item(uri.toString(), file, uri, 1, { root, file });
      item.error = errors.length ? errors.join("\n") : undefined;
      const children = sections.map(({ name, line }) =>
        this.item(`${uri}#${name}`, name, uri, line, { root, file, section: name }),
      );
      item.children.replace(children);
      if (children.length || errors.length) this.controller.items.add(item);
    }
  }

  item(id, label, uri, line, known) {
    const item = this.controller.createTestItem(id, label, uri);
    item.range = new vscode.Range(Math.max(line - 1, 0), 0, Math.max(line - 1, 0), 0);
    this.known.set(item, known);
    return item;
  }

  async start(request, token) {
    const wanted = [];
    const excluded = new Set(request.exclude ?? []);
    const add = (item) => {
      if (excluded.has(item)) return;
      if (item.children.size) item.children.forEach(add);
      else wanted.push(item);
    };
    if (request.include) request.include.forEach(add);
    else this.controller.items.forEach(add);
    const runs = this.controller.createTestRun(request);
    wanted.forEach((item) => runs.enqueued(item));
    for (const { root, file, items, filters } of grouped(wanted, this.known)) {
      if (token.isCancellationRequested) break;
      items.forEach((item) => runs.started(item));
      try {
        const report = await run(this.program(), ["test", file, "--json", ...filters], root, token);
        this.tell(runs, items, outcomes(report));
      } catch (error) {
        items.forEach((item) => runs.errored(item, new vscode.TestMessage(error.message)));
      }
    }
    runs.end();
  }

  tell(runs, items, results) {
    for (const item of items) {
      const { root, section } = this.known.get(item);
      const result = results.find((result) => result.section === section);
      if (!result || result.status === "skipped") {
        runs.skipped(item);
        continue;
      }
      if (result.printed) runs.appendOutput(result.printed.replace(/\n/g, "\r\n") + "\r\n", undefined, item);
      const messages = result.messages.map((message) => this.message(root, message));
      const duration = result.seconds * 1000;
      if (result.status === "passed") runs.passed(item, duration);
      else if (result.status === "failed") runs.failed(item, messages, duration);
      else runs.errored(item, messages, duration);
    }
  }

  message(root, { text, file, line, column, expected, got }) {
    const message = new vscode.TestMessage(text);
    if (file && line) {
      const place = new vscode.Position(line - 1, Math.max(column - 1, 0));
      message.location = new vscode.Location(vscode.Uri.file(path.resolve(root, file)), place);
    }
    if (expected && got) {
      message.expectedOutput = expected;
      message.actualOutput = got;
    }
    return message;
  }
}

module.exports = { TestExplorer, run };

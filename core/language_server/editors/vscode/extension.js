// The client of `choreo lsp` for Visual Studio Code: starts the server, shows rendered frames, and runs tests in the test explorer.

const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");
const { TestExplorer } = require("./tests");

const RENDER = "choreo.renderFrame";
const VIEW = "choreo.openViewer";

let client;

function program() {
  return vscode.workspace.getConfiguration("choreo").get("path") || "choreo";
}

// The settings that the server knows: see core/language_server/src/settings.rs.
function settings() {
  const { inlayHints, codeLenses } = vscode.workspace.getConfiguration("choreo");
  return { inlayHints, codeLenses };
}

async function save(uri) {
  const document = vscode.workspace.textDocuments.find((document) => document.uri.toString() === uri);
  if (document?.isDirty) await document.save();
}

// Commands of the server: the program reads saved files, and an image is shown beside the script.
async function execute(command, args, next) {
  const [argument] = args;
  if (!argument?.uri) return next(command, args);
  await save(vscode.Uri.parse(argument.uri).toString());
  const result = await next(command, [{ ...argument, silent: command === RENDER }]);
  if (command === RENDER && result?.path) {
    const beside = { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true, preview: true };
    await vscode.commands.executeCommand("vscode.open", vscode.Uri.file(result.path), beside);
  }
  return result;
}

function atCursor(command) {
  return async () => {
    const editor = vscode.window.activeTextEditor;
    if (editor?.document.languageId !== "rhai") return undefined;
    const uri = editor.document.uri.toString();
    return vscode.commands.executeCommand(command, { uri, line: editor.selection.active.line });
  };
}

async function start() {
  const server = { command: program(), args: ["lsp"] };
  client = new LanguageClient("choreo", "choreo", server, {
    documentSelector: [
      { scheme: "file", language: "rhai" },
      { scheme: "untitled", language: "rhai" },
    ],
    initializationOptions: settings(),
    synchronize: {
      configurationSection: "choreo",
      fileEvents: vscode.workspace.createFileSystemWatcher("**/{*.rhai,choreo.toml,*.glb,*.gltf,*.vrm,*.fbx,*.bvh,*.dae,*.obj}"),
    },
    middleware: { executeCommand: execute },
  });
  try {
    await client.start();
  } catch (error) {
    const open = "Open Settings";
    const why = `choreo: the language server "${server.command}" did not start: ${error.message ?? error}`;
    if ((await vscode.window.showErrorMessage(why, open)) === open) {
      await vscode.commands.executeCommand("workbench.action.openSettings", "choreo.path");
    }
  }
}

async function stop() {
  const running = client;
  client = undefined;
  if (running?.needsStop()) await running.stop();
}

async function restart() {
  // A server that does not stop in order is ended by the client library.
  await stop().catch(() => undefined);
  await start();
}

async function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand("choreo.renderFrameHere", atCursor(RENDER)),
    vscode.commands.registerCommand("choreo.openViewerHere", atCursor(VIEW)),
    vscode.commands.registerCommand("choreo.restartServer", restart),
    vscode.workspace.onDidChangeConfiguration((change) => {
      if (change.affectsConfiguration("choreo.path")) return restart();
      return undefined;
    }),
    new TestExplorer(program),
  );
  await start();
}

module.exports = { activate, deactivate: stop };

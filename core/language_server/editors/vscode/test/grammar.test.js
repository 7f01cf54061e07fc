// The grammar, by the tokenizer of the editor itself. TOOLS is a folder with its packages, SCRIPTS one with scripts.

const assert = require("node:assert");
const fs = require("node:fs");
const path = require("node:path");
const test = require("node:test");

const tools = path.join(process.env.TOOLS, "node_modules");
const { Registry, INITIAL, parseRawGrammar } = require(path.join(tools, "vscode-textmate"));
const oniguruma = require(path.join(tools, "vscode-oniguruma"));

async function grammar() {
  await oniguruma.loadWASM(fs.readFileSync(path.join(tools, "vscode-oniguruma/release/onig.wasm")));
  const onigLib = Promise.resolve({
    createOnigScanner: (patterns) => new oniguruma.OnigScanner(patterns),
    createOnigString: (text) => new oniguruma.OnigString(text),
  });
  const file = path.join(__dirname, "../syntaxes/rhai.tmLanguage.json");
  const loadGrammar = async () => parseRawGrammar(fs.readFileSync(file, "utf8"), file);
  return new Registry({ onigLib, loadGrammar }).loadGrammar("source.rhai");
}

// The innermost scope of each token that is no blank, and whether the text ends outside strings and comments.
function scopes(rhai, text) {
  let rules = INITIAL;
  const found = [];
  for (const line of text.split(/\r?\n/)) {
    const result = rhai.tokenizeLine(line, rules);
    rules = result.ruleStack;
    for (const { startIndex, endIndex, scopes } of result.tokens) {
      const part = line.slice(startIndex, endIndex);
      if (part.trim()) found.push([part, scopes.at(-1)]);
    }
  }
  return { found, depth: rules.depth };
}

test("words, numbers, strings and comments have scopes", async () => {
  const rhai = await grammar();
  const { found, depth } = scopes(
    rhai,
    'let a = -1.5e3; // b\n/* c /* d */ e */ f(a).loop("g\\n", `h ${k + 1} l`, #{ m: true, "n": 0x1F });\nfor i in 0..8 { x::y(1.2) }',
  );
  const of = (part) => found.find(([text]) => text.trim() === part)?.[1];
  const expected = {
    let: "storage.type.rhai",
    a: "variable.other.rhai",
    "1.5e3": "constant.numeric.decimal.rhai",
    "// b": "comment.line.double-slash.rhai",
    c: "comment.block.rhai",
    e: "comment.block.rhai",
    f: "entity.name.function.rhai",
    loop: "entity.name.function.member.rhai",
    g: "string.quoted.double.rhai",
    "\\n": "constant.character.escape.rhai",
    h: "string.interpolated.rhai",
    k: "variable.other.rhai",
    l: "string.interpolated.rhai",
    m: "variable.other.key.rhai",
    true: "constant.language.boolean.rhai",
    "0x1F": "constant.numeric.hex.rhai",
    for: "keyword.control.rhai",
    0: "constant.numeric.decimal.rhai",
    "..": "keyword.operator.rhai",
    8: "constant.numeric.decimal.rhai",
    x: "entity.name.namespace.rhai",
    y: "entity.name.function.rhai",
    "1.2": "constant.numeric.decimal.rhai",
  };
  for (const [part, scope] of Object.entries(expected)) assert.strictEqual(of(part), scope, part);
  assert.strictEqual(depth, 1);
});

test("every script of the project ends outside strings, comments and brackets", async () => {
  const rhai = await grammar();
  const scripts = fs.readdirSync(process.env.SCRIPTS, { recursive: true }).filter((name) => name.endsWith(".rhai"));
  assert.ok(scripts.length > 40);
  for (const name of scripts) {
    const { found, depth } = scopes(rhai, fs.readFileSync(path.join(process.env.SCRIPTS, name), "utf8"));
    assert.strictEqual(depth, 1, name);
    const plain = found.filter(([part, scope]) => scope === "source.rhai" && /\S/.test(part));
    assert.deepStrictEqual(plain, [], name);
  }
});

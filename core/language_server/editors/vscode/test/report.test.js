const assert = require("node:assert");
const test = require("node:test");
const { grouped, listed, outcomes } = require("../report");

test("sections are listed by file", () => {
  const sections = [
    { file: "a.rhai", section: "x", line: 3 },
    { file: "b.rhai", errors: ["b.rhai:1:1: no"] },
    { file: "a.rhai", section: "y", line: 7 },
    { file: "c.rhai", section: "", line: 0 },
  ];
  assert.deepStrictEqual(listed({ sections }), [
    { file: "a.rhai", errors: [], sections: [{ name: "x", line: 3 }, { name: "y", line: 7 }] },
    { file: "b.rhai", errors: ["b.rhai:1:1: no"], sections: [] },
    { file: "c.rhai", errors: [], sections: [] },
  ]);
});

test("items are run file by file", () => {
  const [x, y, z] = [{}, {}, {}];
  const known = new Map([
    [x, { root: "/p", file: "a.rhai", section: "x" }],
    [y, { root: "/p", file: "b.rhai" }],
    [z, { root: "/p", file: "a.rhai", section: "z" }],
  ]);
  assert.deepStrictEqual(grouped([x, y, z], known), [
    { root: "/p", file: "a.rhai", items: [x, z], filters: ["--filter=a.rhai > x", "--filter=a.rhai > z"] },
    { root: "/p", file: "b.rhai", items: [y], filters: [] },
  ]);
});

test("a failure is reported with its place", () => {
  const check = {
    title: "x is near 1",
    passed: false,
    expected: "1",
    got: "2",
    hint: "look",
    place: { file: "a.rhai", line: 4, column: 5 },
    picture: { expected: "e.png", got: "g.png", difference: null },
  };
  const sections = [
    { section: "x", status: "failed", seconds: 0.5, printed: ["p"], checks: [check, { passed: true }], file: "a.rhai", line: 3 },
    { section: "y", status: "error", text: "broken", checks: [], file: "a.rhai", line: 9 },
  ];
  const [x, y] = outcomes({ sections });
  assert.deepStrictEqual(x.messages, [
    {
      text: "x is near 1\nexpected 1\ngot 2\nhint: look\nexpected image: e.png\ngot image: g.png",
      expected: "1",
      got: "2",
      file: "a.rhai",
      line: 4,
      column: 5,
    },
  ]);
  assert.deepStrictEqual([x.section, x.status, x.seconds, x.printed], ["x", "failed", 0.5, "p"]);
  assert.deepStrictEqual(y.messages, [{ text: "broken", file: "a.rhai", line: 9, column: 1 }]);
  assert.throws(() => outcomes({ ok: false, errors: [{ message: "no such file" }] }), /no such file/);
});

// Reports of `choreo test --json`, as the test explorer needs them.

// `--list --json` by file.
function listed(list) {
  const files = new Map();
  for (const { file, section, line, errors } of list.sections ?? []) {
    if (!files.has(file)) files.set(file, { file, errors: [], sections: [] });
    const known = files.get(file);
    if (errors) known.errors.push(...errors);
    // A script without sections is one test without a name.
    else if (section) known.sections.push({ name: section, line: line || 1 });
  }
  return [...files.values()];
}

// The items of each file, and the filters that select them; a file as a whole needs none.
function grouped(items, known) {
  const groups = new Map();
  for (const item of items) {
    const { root, file, section } = known.get(item);
    const key = `${root}\n${file}`;
    if (!groups.has(key)) groups.set(key, { root, file, items: [], filters: [] });
    const group = groups.get(key);
    group.items.push(item);
    if (section) group.filters.push(`--filter=${file} > ${section}`);
  }
  return [...groups.values()];
}

function outcomes(report) {
  if (!report.sections) {
    const text = (report.errors ?? []).map((error) => error.message).join("\n");
    throw new Error(text || "the report has no sections");
  }
  return report.sections.map((section) => ({
    section: section.section || undefined,
    status: section.status,
    seconds: section.seconds ?? 0,
    printed: (section.printed ?? []).join("\n"),
    messages: messages(section),
  }));
}

// What failed: a message for each check, else the error of the section.
function messages(section) {
  const failed = (section.checks ?? []).filter((check) => !check.passed);
  if (!failed.length) {
    return section.text ? [{ text: section.text, file: section.file, line: section.line, column: 1 }] : [];
  }
  return failed.map((check) => {
    const lines = [check.title];
    if (check.expected) lines.push(`expected ${check.expected}`);
    if (check.got) lines.push(`got ${check.got}`);
    if (check.hint) lines.push(`hint: ${check.hint}`);
    const { expected, got, difference } = check.picture ?? {};
    for (const [word, image] of Object.entries({ expected, got, difference })) {
      if (image) lines.push(`${word} image: ${image}`);
    }
    return {
      text: lines.join("\n"),
      expected: check.expected,
      got: check.got,
      file: check.place?.file ?? section.file,
      line: check.place?.line ?? section.line,
      column: check.place?.column ?? 1,
    };
  });
}

module.exports = { grouped, listed, outcomes };

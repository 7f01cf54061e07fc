const filter = document.getElementById("filter"), only = document.getElementById("only"), shown = document.getElementById("shown");
function apply() {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0, all = 0;
  for (const file of document.querySelectorAll("section.file")) {
    const name = file.querySelector("h2").textContent.toLowerCase();
    let some = false;
    for (const test of file.querySelectorAll("details.case")) {
      const text = name + " " + test.textContent.toLowerCase();
      const fits = words.every(w => text.includes(w)) && (!only.checked || test.classList.contains("bad"));
      test.hidden = !fits;
      some ||= fits;
      count += fits;
      all++;
    }
    file.hidden = !some;
  }
  shown.textContent = count === all ? "" : count + " of " + all + " sections";
}
filter.addEventListener("input", apply);
only.addEventListener("change", apply);

const rows = [...document.querySelectorAll("table.list tbody tr")];
const body = document.querySelector("table.list tbody");
const search = document.getElementById("search"), kind = document.getElementById("kind");
const cause = document.getElementById("cause"), shown = document.getElementById("shown");
const filter = () => {
  const words = search.value.toLowerCase().split(/\s+/).filter(word => word);
  let count = 0;
  for (const row of rows) {
    const there = row.textContent.toLowerCase();
    const fits = words.every(word => there.includes(word)) &&
      (!kind.value || row.dataset.kind === kind.value) &&
      (!cause.value || row.dataset.cause === cause.value);
    row.hidden = !fits;
    count += fits;
  }
  shown.textContent = count + " of " + rows.length + " loops";
};
for (const input of [search, kind, cause]) input.addEventListener("input", filter);
const heads = [...document.querySelectorAll("table.list thead th")];
heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
  const now = head.getAttribute("aria-sort"), first = head.matches(".t, .up");
  const up = now ? now !== "ascending" : first;
  heads.forEach(other => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", up ? "ascending" : "descending");
  const of = row => row.children[column].dataset.value;
  rows.sort((one, other) => {
    const a = of(one), b = of(other);
    if (a === "" || b === "") return (a === "") - (b === "");
    const order = isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b;
    return up ? order : -order;
  });
  body.append(...rows);
}));

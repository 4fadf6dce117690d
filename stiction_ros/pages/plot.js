const HOUR = 3600, DAY = 86400, views = new Map();
// steps between two dates on an axis, s
const CALENDAR = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800,
  1 * HOUR, 2 * HOUR, 3 * HOUR, 6 * HOUR, 12 * HOUR,
  1 * DAY, 2 * DAY, 7 * DAY, 14 * DAY, 28 * DAY, 91 * DAY, 182 * DAY, 364 * DAY];
const show = (view, a, b) => {
  const least = (view.high - view.low) / 500, span = Math.max(b - a, least);
  view.a = Math.max(view.low, Math.min(a, view.high - span));
  view.b = Math.min(view.high, view.a + span);
  for (const draw of view.drawn) draw();
  view.whole.disabled = view.a === view.low && view.b === view.high;
};
const ticks = (a, b, dated, unit) => {
  let step = dated ? CALENDAR.find(one => (b - a) / one <= 8) || CALENDAR.at(-1)
    : Math.pow(10, Math.floor(Math.log10((b - a) / 3)));
  if (!dated && (b - a) / step > 12) step *= 2.5;
  if (!dated && (b - a) / step > 8) step *= 2;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
  for (let k = Math.ceil(a / step - 1e-9); k * step <= b + 1e-9 * step; k++) {
    const iso = dated && new Date(1000 * k * step).toISOString();
    const day = dated && +iso.slice(8, 10) + " " + new Date(1000 * k * step).toLocaleString("en",
      { month: "short", timeZone: "UTC" });
    const clock = dated && (step % 86400 ? iso.slice(11, step % 60 ? 19 : 16) : "");
    const plain = (k * step).toFixed(digits) + (found.length ? "" : unit);
    found.push([k * step, !dated ? plain : !clock || !(k * step % 86400) ? day
      : found.length ? clock : day + " " + clock]);
  }
  return found;
};
const toolbar = figure => {
  const low = +figure.dataset.low, high = +figure.dataset.high;
  const view = { low, high, a: low, b: high, drawn: [] }, bar = document.createElement("div");
  bar.className = "zoom";
  bar.setAttribute("role", "group");
  bar.setAttribute("aria-label", "Time that the figures show");
  const button = (name, act) => {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = name;
    made.addEventListener("click", act);
    bar.append(made);
    return made;
  };
  const turn = (from, to) => () => { const wide = view.b - view.a;
    show(view, view.a + from * wide, view.b + to * wide); };
  button("closer", turn(0.25, -0.25));
  button("wider", turn(-0.5, 0.5));
  button("earlier", turn(-0.5, -0.5));
  button("later", turn(0.5, 0.5));
  view.whole = button("all", () => show(view, low, high));
  view.whole.disabled = true;
  figure.before(bar);
  return view;
};
for (const figure of document.querySelectorAll("figure.plot[data-low]")) {
  const svg = figure.querySelector("svg"), area = svg.querySelector("svg");
  const key = figure.dataset.low + " " + figure.dataset.high;
  if (!views.has(key)) views.set(key, toolbar(figure));
  const view = views.get(key), whole = area.getAttribute("viewBox").split(" ").map(Number);
  const axis = svg.querySelector("g.x"), dated = "dated" in figure.dataset;
  let from = null;
  const draw = () => {
    const { a, b, low, high } = view, scale = whole[2] / (high - low);
    area.setAttribute("viewBox",
      [(a - low) * scale, whole[1], (b - a) * scale, whole[3]].join(" "));
    axis.textContent = "";
    for (const [value, label] of ticks(a, b, dated, figure.dataset.unit)) {
      const tick = document.createElementNS("http://www.w3.org/2000/svg", "text");
      tick.setAttribute("x", 100 * (value - a) / (b - a) + "%");
      tick.setAttribute("y", axis.dataset.y);
      tick.setAttribute("text-anchor", "middle");
      tick.textContent = label;
      axis.append(tick);
    }
  };
  view.drawn.push(draw);
  draw();
  const at = event => {
    const box = area.getBoundingClientRect();
    const share = (event.clientX - box.left) / box.width;
    return view.a + (view.b - view.a) * Math.min(Math.max(share, 0), 1);
  };
  svg.addEventListener("pointerdown", event => { from = at(event); });
  svg.addEventListener("pointerup", event => {
    const to = at(event);
    if (from !== null && Math.abs(to - from) > (view.high - view.low) / 200)
      show(view, Math.min(from, to), Math.max(from, to));
    from = null;
  });
}

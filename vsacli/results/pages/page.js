"use strict";
/* The parts around the plots: time and zoom, filters, lanes of findings, sections, keys. */
(() => {
  const { data, state, element, number } = vsacli;
  const byId = (name) => document.getElementById(name);
  /* Colors of what may be wrong, the worst first. */
  const SHADES = { infeasible: "infeasible", singular: "singular", "near-singular": "near-singular",
                     "over a limit": "over-limit", unreliable: "unreliable" };

  document.querySelectorAll(".line").forEach((line) => {
    if (/^(warning|.*: warning):/.test(line.textContent)) line.classList.add("warning");
  });
  byId("library").textContent = data.library;
  if (data.kind !== "over time") return;
  byId("stage").hidden = byId("keys").hidden = false;

  function addSections() {
    for (const { heading, shown, paired, charts } of data.sections) {
      const section = element("details", { class: "section" }, element("summary", {}, heading));
      const place = element("div", { class: paired ? "charts paired" : "charts" });
      section.append(place);
      section.open = shown;
      section.addEventListener("toggle", () => { if (section.open) vsacli.charts.buildRest(); });
      byId("plots").append(section);
      vsacli.charts.add(place, charts);
    }
  }

  function addFilter(set, key, label, swatch) {
    const button = element("button", { type: "button", class: "chip", "aria-pressed": "true",
                                       title: "hide or show; with Shift show this alone" }, ...swatch, label);
    button.addEventListener("click", (event) => {
      if (event.shiftKey) { set.clear(); set.add(key); } else if (!set.delete(key)) set.add(key);
      vsacli.tell("shown");
    });
    vsacli.listen("shown", () => button.setAttribute("aria-pressed", String(set.has(key))));
    byId("filters").append(button);
  }

  function addFilters() {
    data.joints.forEach(({ name }, joint) => {
      const swatch = element("i", { class: "swatch" });
      swatch.style.borderTopColor = vsacli.named(joint);
      addFilter(state.joints, joint, name, [swatch]);
    });
    if (data.files.length > 1) {
      const { DASHES } = vsacli.figures;
      data.files.forEach(({ label }, file) => {
        const swatch = element("i", { class: "swatch" });
        swatch.style.borderTopStyle = DASHES[file % DASHES.length][1];
        addFilter(state.files, file, label, [swatch]);
      });
    }
  }

  /* A lane of time for each joint and file in which something is wrong. */
  function addTroubles() {
    const place = byId("troubles"), kinds = new Set();
    data.files.forEach((file, at) => {
      data.joints.forEach(({ name }, joint) => {
        const found = Object.entries(file.troubles).filter(([, spans]) => spans[joint].length);
        if (found.length) addLane(data.files.length > 1 ? `${name}, ${file.label}` : name, found.map(([kind, spans]) => [kind, spans[joint]]));
        found.forEach(([kind]) => kinds.add(kind));
      });
      if (file.unreliable.length) { addLane("unreliable ends of the recording", [["unreliable", file.unreliable]]); kinds.add("unreliable"); }
    });
    if (!kinds.size) return;
    place.hidden = false;
    const keys = [...kinds].map((kind) => {
      const area = element("span", { class: "area" });
      area.style.background = `var(--${SHADES[kind]})`;
      return element("span", { class: "key" }, area, kind);
    });
    place.prepend(element("div", { class: "legend" }, ...keys));
  }

  function addLane(label, found) {
    const [start, end] = data.span, length = end - start || 1, lane = element("div", { class: "lane" });
    const percent = (time) => `${100 * (time - start) / length}%`;
    for (const [kind, spans] of found.reverse()) {
      for (const [from, to] of spans) {
        const mark = element("i", { title: `${kind}: ${number(from + data.start)} to ${number(to + data.start)} s` });
        Object.assign(mark.style, { left: percent(from), width: `${100 * (to - from) / length}%`, background: `var(--${SHADES[kind]})` });
        lane.append(mark);
      }
    }
    const cursor = element("b");
    lane.append(cursor);
    const follow = () => { cursor.style.left = percent(state.cursor); };
    follow();
    vsacli.listen("cursor", follow);
    lane.addEventListener("click", (event) => {
      const box = lane.getBoundingClientRect();
      vsacli.setCursor(start + length * (event.clientX - box.left) / box.width);
    });
    byId("troubles").append(element("div", { class: "trouble" }, element("span", { title: label }, label), lane));
  }

  /* Time: the slider, and a clock that runs as the robot would, but neither for less than two nor more than 20 s. */
  const SHORTEST_PLAY = 2, LONGEST_PLAY = 20;
  let played = 0;

  function tick(now) {
    if (byId("play").getAttribute("aria-pressed") !== "true") return;
    const length = data.span[1] - data.span[0];
    const pace = length / Math.min(Math.max(length, SHORTEST_PLAY), LONGEST_PLAY);
    const next = state.cursor + pace * (now - played) / 1000;
    played = now;
    vsacli.setCursor(next > data.span[1] ? data.span[0] : next);
    requestAnimationFrame(tick);
  }

  function play() {
    const running = byId("play").getAttribute("aria-pressed") === "true";
    byId("play").setAttribute("aria-pressed", String(!running));
    byId("play").textContent = running ? "play" : "pause";
    played = performance.now();
    if (!running) requestAnimationFrame(tick);
  }

  function addTime() {
    const slider = byId("cursor");
    [slider.min, slider.max, slider.step] = [data.span[0], data.span[1], (data.span[1] - data.span[0]) / 1000 || 1];
    slider.value = state.cursor;
    slider.addEventListener("input", () => vsacli.setCursor(Number(slider.value)));
    const follow = () => {
      slider.value = state.cursor;
      byId("time").textContent = `${(state.cursor + data.start).toFixed(4)} s`;
    };
    follow();
    vsacli.listen("cursor", follow);
  }

  /* Show a multiple of the time shown, around the cursor if that is in sight. */
  function zoom(factor) {
    const [start, end] = state.window;
    const seen = start <= state.cursor && state.cursor <= end;
    const center = seen ? state.cursor : (start + end) / 2;
    vsacli.setWindow(center - factor * (center - start), center + factor * (end - center));
  }

  const STEP = 1 / 200;  // of what is shown, by which an arrow key moves the cursor
  const KEYS = {
    " ": play,
    "+": () => zoom(0.5),
    "-": () => zoom(2),
    0: () => vsacli.tell("reset"),
    ArrowLeft: () => vsacli.setCursor(state.cursor - STEP * (state.window[1] - state.window[0])),
    ArrowRight: () => vsacli.setCursor(state.cursor + STEP * (state.window[1] - state.window[0])),
  };

  function addKeys() {
    byId("play").addEventListener("click", play);
    byId("zoom-in").addEventListener("click", () => zoom(0.5));
    byId("zoom-out").addEventListener("click", () => zoom(2));
    byId("zoom-all").addEventListener("click", () => vsacli.tell("reset"));
    addEventListener("keydown", (event) => {
      const own = event.target.closest("button, summary, input") && [" ", "ArrowLeft", "ArrowRight"].includes(event.key);
      if (own || event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
      KEYS[event.key]();
      event.preventDefault();
    });
  }

  /* A page opens where the worst begins. */
  function beginning() {
    for (const kind of Object.keys(SHADES)) {
      const starts = data.files.flatMap((file) => (file.troubles[kind] || []).flat()).map(([start]) => start);
      if (starts.length) return Math.min(...starts);
    }
    return data.span[0];
  }

  /* The robot stands below what stays on top. */
  new ResizeObserver(() => {
    document.documentElement.style.setProperty("--stage", `${byId("stage").offsetHeight}px`);
  }).observe(byId("stage"));

  state.cursor = beginning();
  addSections();
  addFilters();
  addTroubles();
  addTime();
  addKeys();
  vsacli.robot.draw();
  setTimeout(() => vsacli.charts.buildRest(), 50);
})();

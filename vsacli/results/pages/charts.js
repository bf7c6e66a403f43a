"use strict";
/* The plots over time: each a card with a legend that shows the values at the cursor; one window of time for all. */
vsacli.charts = (() => {
  const { data, state, array, valueAt, number, color, curveColor, element } = vsacli;
  const { FAILURES, IN_STRIPS, STRIP, dash, addSeries, areasOf, addAreas, newFigure, addTools } = vsacli.figures;
  const NEAR = 0.5, ROOM = 0.06;  // how far limits may be from curves to be shown, and room left; in heights of the curves
  const MANY = 8;  // joints, from which on a legend scrolls
  const cards = [];

  class Card {
    constructor(chart) {
      this.chart = chart;
      this.plot = element("div", { class: "plot" });
      this.values = [];
      this.keys = [...new Set(chart.series.map((series) => series.label))].map((label) => this.key(label));
      const legend = element("div", { class: this.keys.length > MANY ? "legend long" : "legend" }, ...this.keys);
      if (chart.limits.length) legend.append(element("span", { class: "key" }, element("i", { class: "swatch limit" }), "limit"));
      if (chart.band) {
        this.area = element("span", { class: "area" });
        legend.append(element("span", { class: "key" }, this.area, chart.band));
      }
      this.strips = FAILURES.map((kind) => [kind, stripKey(kind)]);
      legend.append(...this.strips.map(([, key]) => key));
      if (chart.note) legend.append(element("span", { class: "note" }, chart.note));
      this.node = element("figure", { class: "chart" },
        element("figcaption", {}, chart.title, " ", element("code", {}, chart.name)), this.plot, legend);
      this.node.card = this;
    }

    /* What the legend says of a joint: each of its curves, by dashes and role, with the value at the cursor. */
    key(label) {
      const box = element("span", { class: "key" }, `${label} `);
      for (const series of this.chart.series.filter((each) => each.label === label)) {
        const swatch = element("i", { class: "swatch" }), value = element("b"), role = ["computed", label].includes(series.role) ? "" : series.role;
        const rms = series.rms === null ? "" : `rms ${number(series.rms)}, now `;
        const part = element("span", { class: "key", title: data.files[series.file].label }, swatch, role, rms, value);
        this.values.push({ series, swatch, value, part });
        box.append(part);
      }
      return box;
    }

    /* The attainable range has a color of its own; uncertainty that of its curve. */
    get bandColor() {
      return this.chart.name === "stiffness" ? "attainable" : "";
    }

    get visible() {
      const box = this.node.getBoundingClientRect();
      return box.width > 0 && box.bottom > -200 && box.top < innerHeight + 200;
    }

    /* Whether the section is open; plots in closed ones are laid out all the same, so that their size does not tell. */
    get open() {
      return !this.node.closest("details:not([open])");
    }

    async build() {
      if (this.figure || !this.open) return;
      const [start, end] = state.window.map((time) => time + data.start);
      const ranges = { x_range: new Bokeh.Range1d({ start, end }), y_range: new Bokeh.Range1d(this.extent()) };
      this.figure = newFigure(ranges, ["time [s]", `[${this.chart.unit}]`]);
      addTools(this.figure);
      this.place = addAreas(this.figure);
      this.curves = this.chart.series.map((series) => addSeries(this.figure, series, this.bandColor && color(this.bandColor)));
      this.addLimits();
      this.span = new Bokeh.Span({ dimension: "height", location: state.cursor + data.start,
                                   line_color: color("cursor"), line_width: 1 });
      this.figure.add_layout(this.span);
      this.follow();
      this.show();
      this.view = await Bokeh.Plotting.show(this.figure, this.plot);
      this.update();
    }

    /* What the axis of values shows at first: all curves that are not hidden, and strips of failures below them. */
    extent() {
      const { start, end } = this.curveExtent(), room = STRIP * (this.marked.strips && this.marked.strips + 1);
      return { start: start - (end - start) * room / (1 - room), end };
    }

    /* The range of the curves that are not hidden, and of limits that are near them. */
    curveExtent() {
      if (this.chart.shown) return { start: this.chart.shown[0], end: this.chart.shown[1] };
      let low = Infinity, high = -Infinity;
      for (const series of this.chart.series.filter(vsacli.shown)) {
        for (const value of array(series.values)) {
          if (value < low) low = value;
          if (value > high) high = value;
        }
      }
      if (low > high) return { start: 0, end: 1 };
      const height = high - low || Math.abs(high) || 1;
      const near = this.chart.limits.filter(({ joint, value }) => (joint === null || state.joints.has(joint))
        && value > low - NEAR * height && value < high + NEAR * height).map(({ value }) => value);
      return { start: Math.min(low, ...near) - ROOM * height, end: Math.max(high, ...near) + ROOM * height };
    }

    addLimits() {
      this.limits = this.chart.limits.map(({ joint, value }) => ({ joint, line: this.figure.hspan([value], {
        line_color: joint === null ? color("soft") : curveColor(joint), line_dash: "dotted", line_width: 1.2 }) }));
    }

    follow() {
      const x = this.figure.x_range;
      x.change.connect(() => {
        const [start, end] = state.window.map((time) => time + data.start);
        if (x.start !== start || x.end !== end) vsacli.setWindow(x.start - data.start, x.end - data.start, this);
      });
      this.figure.y_range.change.connect(() => this.place(this.marked.areas));
      this.figure.on_event("mousemove", (event) => vsacli.setCursor(event.x - data.start));
      this.figure.on_event("doubletap", () => vsacli.tell("reset"));
    }

    /* Take over window, cursor and values, if there is somebody to see it. */
    update(seen = this.visible) {
      if (!seen) return;
      this.values.forEach(({ series, value }) => {
        value.textContent = number(valueAt(array(series.time), array(series.values), state.cursor));
      });
      if (!this.figure) return;
      const [start, end] = state.window.map((time) => time + data.start);
      const x = this.figure.x_range;
      if (x.start !== start || x.end !== end) x.setv({ start, end });
      this.span.location = state.cursor + data.start;
    }

    reset() {
      if (!this.figure) return;
      this.figure.y_range.setv(this.extent());
      this.place(this.marked.areas);
    }

    /* Hide what the filters hide. */
    show() {
      this.marked = areasOf(this.chart.series.filter(vsacli.shown));
      const kinds = new Set(this.marked.strips ? this.marked.areas.map(({ kind }) => kind) : []);
      this.strips.forEach(([kind, key]) => key.classList.toggle("hidden", !kinds.has(kind)));
      if (this.area) this.area.style.background = `var(--${this.bandColor || "soft"})`;
      this.values.forEach(({ series, part, swatch }) => {
        part.classList.toggle("hidden", !vsacli.shown(series));
        swatch.style.borderTopColor = vsacli.named(series.color);
        swatch.style.borderTopStyle = dash(series)[1];
      });
      this.keys.forEach((key) => key.classList.toggle("hidden", !key.querySelector(".key:not(.hidden)")));
      for (const { series, drawn } of this.curves || []) drawn.forEach((each) => { each.visible = vsacli.shown(series); });
      for (const { joint, line } of this.limits || []) line.visible = joint === null || state.joints.has(joint);
      this.reset();
    }

    print() {
      if (!this.view || !this.open) return;
      this.update(true);
      vsacli.figures.copyForPaper(this.view, this.plot);
    }

    fail(error) {
      console.error(error);
      this.plot.textContent = `cannot be drawn: ${error.message}`;
    }

    drop() {
      this.plot.replaceChildren();
      this.figure = this.view = undefined;
    }
  }

  function stripKey(kind) {
    const area = element("span", { class: kind === "singular" ? "area hatched" : "area strip" });
    area.style.opacity = IN_STRIPS[kind];
    return element("span", { class: "key hidden" }, area, `${kind}, by color of joint`);
  }

  function add(parent, charts) {
    const made = charts.map((chart) => new Card(chart));
    made.forEach((card) => { parent.append(card.node); card.show(); watcher.observe(card.node); });
    cards.push(...made);
  }

  /* Plots are built one after the other, so that the first is there soon. */
  let first = true, queue = Promise.resolve();
  function build(card) {
    queue = queue.then(() => card.build()).catch((error) => card.fail(error)).then(() => {
      if (first && card.figure) performance.mark("first plot");
      first = first && !card.figure;
      return new Promise((done) => { setTimeout(done, 0); });
    });
    return queue;
  }

  const watcher = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (isIntersecting) build(target.card).then(() => target.card.update());
    }
  }, { rootMargin: "300px" });

  /* Plots of open sections that are out of sight, when idle: they may be printed. */
  async function buildRest() {
    for (const card of cards) {
      if (!card.figure && card.open) await build(card);
    }
    document.documentElement.dataset.ready = "yes";
  }

  let waiting = false;
  function updateSoon() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; cards.forEach((card) => card.update()); });
  }
  vsacli.listen("cursor", updateSoon);
  vsacli.listen("window", updateSoon);
  vsacli.listen("shown", () => cards.forEach((card) => card.show()));
  vsacli.listen("reset", () => { cards.forEach((card) => card.reset()); vsacli.setWindow(...data.span); });
  vsacli.listen("scheme", () => { cards.forEach((card) => { card.drop(); card.show(); }); buildRest(); });
  vsacli.listen("paper", () => cards.forEach((card) => card.print()));
  vsacli.listen("screen", () => { cards.forEach((card) => vsacli.figures.removeCopy(card.plot)); updateSoon(); });
  addEventListener("scroll", updateSoon, { passive: true });
  return { add, buildRest, cards };
})();

"use strict";
/* The plots of studies: margin and cost of each run, over what varies; one run can be chosen in all of them. */
(() => {
  const { data, array, number, color, curveColor, element } = vsacli;
  if (data.kind !== "study") return;
  const { newFigure, addTools, copyForPaper, removeCopy } = vsacli.figures;
  const place = document.getElementById("plots");
  /* Color of a curve and mark by verdict, as in the figures. */
  const MARKS = { ok: [2, "circle"], "over limit": [4, "triangle"], singular: [5, "diamond"], infeasible: [1, "x"], unreliable: [3, "square"] };
  const OTHER = [7, "cross"], PALE = 0.3;
  let plots = [], section;

  const MOST_COPIED = 3000;  // runs of a study, since copying a point for paper takes 0.1 ms
  const ROOM = 0.05;  // left around all points, relative to what they span

  function rangeOf(arrays) {
    let low = Infinity, high = -Infinity;
    for (const value of arrays.flatMap((each) => [...each])) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (low > high) [low, high] = [0, 1];
    const room = ROOM * (high - low) || Math.abs(high) || 1;
    return new Bokeh.Range1d({ start: low - room, end: high + room });
  }

  /* Tools, and what a double click does: show all. */
  function finish(figure) {
    addTools(figure);
    const shown = [figure.x_range, figure.y_range].map(({ start, end }) => ({ start, end }));
    figure.on_event("doubletap", () => [figure.x_range, figure.y_range].forEach((range, axis) => range.setv(shown[axis])));
  }

  function card(parent, title, tall) {
    const plot = element("div", { class: tall ? "plot tall" : "plot" });
    const legend = element("div", { class: "legend" });
    parent.append(element("figure", { class: "chart" }, element("figcaption", {}, title), plot, legend));
    return { plot, legend };
  }

  function addKey(legend, curve, words) {
    const area = element("span", { class: "area" });
    area.style.background = vsacli.named(curve);
    legend.append(element("span", { class: "key" }, area, words));
  }

  /* A plot of points, each a run: x and y, (runs,), NaN where there is none; runs that are not ok are pale on request. */
  function scatter(study, parent, title, [x, xLabel], [y, yLabel], alphaOfOthers = 1) {
    const { plot, legend } = card(parent, title, true);
    const figure = newFigure({ x_range: rangeOf([x]), y_range: rangeOf([y]) }, [xLabel, yLabel]);
    finish(figure);
    for (const verdict of study.verdicts_drawn) {
      const [curve, marker] = MARKS[verdict] || OTHER, alpha = verdict === "ok" ? 1 : alphaOfOthers;
      const rows = [...study.verdicts.keys()].filter((row) => study.verdicts[row] === verdict && Number.isFinite(x[row] + y[row]));
      if (!rows.length) continue;
      const source = new Bokeh.ColumnDataSource({ data: { x: rows.map((row) => x[row]), y: rows.map((row) => y[row]) } });
      figure.scatter({ field: "x" }, { field: "y" }, { source, size: 6, marker, line_color: curveColor(curve), line_alpha: alpha,
                                                       fill_color: curveColor(curve), fill_alpha: 0.5 * alpha });
      addKey(legend, curve, verdict);
    }
    const chosen = new Bokeh.ColumnDataSource({ data: { x: [], y: [] } });
    figure.scatter({ field: "x" }, { field: "y" }, { source: chosen, size: 14, line_color: color("cursor"), line_width: 2.5,
                                                     fill_color: null });
    figure.on_event("tap", (event) => choose(study, nearest(figure, x, y, event)));
    plots.push({ study, figure, plot, choose: (row) => { chosen.data = { x: [x[row]], y: [y[row]] }; } });
    return figure;
  }

  /* The row whose point is nearest to where somebody clicked, by shares of what the axes show. */
  function nearest(figure, x, y, event) {
    const [wide, high] = [figure.x_range, figure.y_range].map((range) => range.end - range.start);
    let best = -1, least = Infinity;
    for (let row = 0; row < x.length; row += 1) {
      const away = Math.hypot((x[row] - event.x) / wide, (y[row] - event.y) / high);
      if (away < least) [best, least] = [row, away];
    }
    return best;
  }

  function choose(study, row) {
    if (row < 0) return;
    plots.filter((each) => each.study === study).forEach((each) => each.choose(row));
    study.table.querySelectorAll("tr").forEach((line) => line.setAttribute("aria-selected", String(Number(line.dataset.row) === row)));
    if (!study.table.querySelector(`tr[data-row="${row}"]`)) study.table.querySelector("tbody").prepend(line(study, row));
  }

  function line(study, row) {
    const cells = [study.runs[row], study.verdicts[row], ...(study.first_limits ? [study.first_limits[row]] : []), number(array(study.margin)[row])];
    if (study.cost !== null) cells.push(number(array(study.cost)[row]));
    cells.push(...study.varying.map(({ values }) => number(array(values)[row])));
    const made = element("tr", { "data-row": row, tabindex: 0 }, ...cells.map((cell) => element("td", {}, String(cell))));
    made.addEventListener("click", () => choose(study, row));
    made.addEventListener("keydown", (event) => { if (event.key === "Enter") choose(study, row); });
    return made;
  }

  /* The runs with the smallest margins; a run that is chosen in a plot is added. */
  function addTable(study, parent) {
    const heads = ["run", "verdict", ...(study.first_limits ? ["first limit exceeded"] : []), "smallest margin [%]", ...(study.cost === null ? [] : [study.cost_words]),
                   ...study.varying.map(({ words, unit }) => (unit ? `${words} [${unit}]` : words))];
    study.table = element("table", { class: "runs" },
      element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", { scope: "col" }, head)))),
      element("tbody", {}, ...study.worst.map((row) => line(study, row))));
    parent.append(element("p", { class: "note" }, "runs with the smallest margins", element("span", { class: "hint" }, "; click a point or a row to mark its run in all plots")),
                  element("div", { class: "wide" }, study.table));
  }

  function addExceedance() {
    const { plot, legend } = card(section, "share of ok runs with at least this margin; dashed: of runs of any verdict", true);
    const margins = data.studies.map((study) => array(study.exceedance.margins));
    const figure = newFigure({ x_range: rangeOf(margins), y_range: rangeOf([[0, 100]]) }, ["smallest margin [%]", "runs [%]"]);
    finish(figure);
    const step = (curve, look) => {
      const source = new Bokeh.ColumnDataSource({ data: { x: Float64Array.from(array(curve.margins)), y: array(curve.shares) } });
      figure.step({ field: "x" }, { field: "y" }, "before", { source, ...look });
    };
    data.studies.forEach((study, index) => {
      step(study.exceedance, { line_color: curveColor(index), line_width: 1.8 });
      if (study.exceedance_of_all) step(study.exceedance_of_all, { line_color: curveColor(index), line_width: 1, line_dash: "dashed" });
      addKey(legend, index, data.studies.length > 1 ? `${study.label}: ${study.shares}` : study.shares);
    });
    figure.add_layout(new Bokeh.Span({ dimension: "height", location: 0, line_color: color("soft"), line_width: 1 }));
    plots.push({ figure, plot, choose: () => {} });
  }

  function addStudy(study) {
    const details = element("details", { class: "section", open: "" }, element("summary", {}, study.label));
    place.append(details);
    if (study.runs.length < study.of) {
      details.append(element("p", { class: "note" }, `${study.runs.length} of ${study.of} runs are drawn: evenly spaced ones, and those with the smallest margins`));
    }
    addTable(study, details);
    const charts = element("div", { class: "charts" });
    details.append(charts);
    const margin = [array(study.margin), "smallest margin [%]"];
    const cost = study.cost === null ? null : [array(study.cost), study.cost_words];
    if (cost) addFront(study, scatter(study, charts, "cost over margin, and the Pareto front of ok runs", margin, cost, PALE), margin[0], cost[0]);
    for (const { words, unit, values } of study.varying) {
      const varied = [array(values), unit ? `[${unit}]` : ""];
      const figure = scatter(study, charts, `margin over ${words}`, varied, margin);
      figure.add_layout(new Bokeh.Span({ dimension: "width", location: 0, line_color: color("soft"), line_width: 1 }));
      if (cost) scatter(study, charts, `cost over ${words}`, varied, cost);
    }
  }

  function addFront(study, figure, margin, cost) {
    if (study.front.length < 2) return;
    figure.line(study.front.map((row) => margin[row]), study.front.map((row) => cost[row]),
                { line_color: curveColor(0), line_width: 1.5 });
  }

  async function build() {
    place.replaceChildren();
    plots = [];
    section = element("div", { class: "charts" });
    place.append(section);
    addExceedance();
    data.studies.forEach(addStudy);
    for (const each of plots) {
      each.view = await Bokeh.Plotting.show(each.figure, each.plot);
      if (!performance.getEntriesByName("first plot").length) performance.mark("first plot");
    }
    document.documentElement.dataset.ready = "yes";
  }

  vsacli.listen("scheme", build);
  vsacli.listen("paper", () => {
    if (data.studies.some(({ runs }) => runs.length > MOST_COPIED)) return;
    for (const { view, plot } of plots) if (view && !plot.closest("details:not([open])")) copyForPaper(view, plot);
  });
  vsacli.listen("screen", () => plots.forEach(({ plot }) => removeCopy(plot)));
  build();
})();

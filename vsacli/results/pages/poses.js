"use strict";
/* Sliders for the positions of the joints of a robot. */
(() => {
  const { data, state, element, named } = vsacli;
  const place = document.getElementById("sliders");

  const words = (position, sliding) => (sliding ? `${position.toFixed(4)} m`
    : `${position.toFixed(3)} rad, ${(180 / Math.PI * position).toFixed(1)}°`);

  function addSlider({ name, type, home, range: [min, max] }, joint) {
    const swatch = element("i", { class: "swatch" }), said = element("output");
    const slider = element("input", { type: "range", min, max, step: (max - min) / 1000 || 1, "aria-label": `position of ${name}` });
    swatch.style.borderTopColor = named(joint);
    const move = (position) => {
      state.positions[joint] = position;
      said.textContent = words(position, type === "prismatic");
      vsacli.tell("pose");
    };
    const reset = () => { slider.value = home; move(home); };
    slider.addEventListener("input", () => move(Number(slider.value)));
    document.getElementById("home").addEventListener("click", reset);
    place.append(element("label", {}, element("span", { class: "key" }, swatch, name), said, slider));
    reset();
  }

  document.getElementById("poses").hidden = false;
  data.joints.forEach(addSlider);
  vsacli.robot.draw();
  document.documentElement.dataset.ready = "yes";
})();

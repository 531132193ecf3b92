/* The page of a report: its charts, the slider over the maps, and what paper needs. */
const page = JSON.parse(document.getElementById("data").textContent);
const charts = page.charts.map((data) => new Chart(document.getElementById(`chart-${data.key}`), data));

function scaleOf(kind) {
  const scale = document.createElement("div");
  if (kind.legend) {
    for (const entry of kind.legend) {
      const one = document.createElement("span"), colour = document.createElement("span");
      one.className = "class";
      colour.style.background = entry.colour;
      one.append(colour, entry.text);
      scale.append(one);
    }
    return scale;
  }
  const ramp = document.createElement("div"), ends = document.createElement("div");
  ramp.className = "ramp";
  ramp.style.background = `linear-gradient(to right, ${kind.colours.join(", ")})`;
  ends.className = "ends";
  for (const text of [kind.low, kind.text, kind.high]) {
    const part = document.createElement("span");
    part.textContent = text;
    ends.append(part);
  }
  scale.append(ramp, ends);
  return scale;
}

function startSlides(slides) {
  const slider = document.getElementById("slider"), image = document.getElementById("map");
  const bar = document.querySelector(".bar"), caption = document.querySelector(".caption");
  const buttons = slides.kinds.map((kind, number) => {
    const button = document.createElement("button");
    button.type = "button";
    button.setAttribute("role", "radio");
    button.textContent = kind.name;
    button.addEventListener("click", () => { chosen = number; show(); });
    return button;
  });
  let chosen = 0;
  document.querySelector(".kinds").append(...buttons);
  slider.max = slides.frames.length - 1;

  function show() {
    const frame = slides.frames[Number(slider.value)];
    image.src = frame.images[chosen];
    image.alt = `map of the ${slides.kinds[chosen].name}, ${frame.caption}`;
    bar.style.width = `${100 * frame.bar.share}%`;
    bar.firstElementChild.textContent = frame.bar.text;
    caption.textContent = `${Number(slider.value) + 1} of ${slides.frames.length}: ${frame.caption}`;
    slider.setAttribute("aria-valuetext", frame.caption);
    document.querySelector(".scale").replaceChildren(scaleOf(slides.kinds[chosen]));
    buttons.forEach((button, number) => button.setAttribute("aria-checked", String(number === chosen)));
    for (const chart of charts) {
      if (!chart.data.cursor) continue;
      chart.mark = "force" in frame ? [frame.indentation, frame.force] : null;
      chart.placeSlide();
    }
  }

  function layOut(most) {
    const count = slides.frames.length, step = Math.max(1, (count - 1) / (most - 1));
    const numbers = [...new Set(Array.from({length: Math.min(count, most)}, (_, k) => Math.round(k * step)))];
    document.querySelector(".sheet").replaceChildren(...numbers.map((number) => {
      const figure = document.createElement("figure"), copy = document.createElement("img");
      const text = document.createElement("figcaption");
      copy.src = slides.frames[number].images[chosen];
      text.textContent = slides.frames[number].caption;
      figure.append(copy, text);
      return figure;
    }));
  }

  slider.addEventListener("input", show);
  window.addEventListener("beforeprint", () => layOut(12));
  show();
  layOut(12);
}

if (page.slides) startSlides(page.slides);
window.addEventListener("beforeprint", () => {
  for (const chart of charts) chart.resize(chart === charts[0] ? 680 : 420);
  for (const each of document.querySelectorAll("details")) {
    each.dataset.open = each.open ? "1" : "";
    each.open = true;
  }
});
window.addEventListener("afterprint", () => {
  for (const chart of charts) chart.resize(chart.plot.clientWidth);
  for (const each of document.querySelectorAll("details")) each.open = Boolean(each.dataset.open);
});

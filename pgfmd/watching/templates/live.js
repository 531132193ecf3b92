/* The page of `pgfmd watch`: fetches what there is, again and again, until the run has ended. */
const charts = {}, byId = (id) => document.getElementById(id);
const PAUSE = 1500;

function show(found) {
  byId("title").textContent = document.title = found.title;
  byId("state").textContent = found.state;
  byId("state").className = `state ${found.over ? "good" : "fair"}`;
  byId("progress").hidden = found.over || found.progress === null;
  if (found.progress !== null) byId("progress").value = found.progress;
  byId("doubts").replaceChildren(...found.doubts.map((text) => {
    const line = document.createElement("li");
    line.textContent = text;
    return line;
  }));
  for (const data of found.charts) {
    if (charts[data.key]) charts[data.key].replace(data);
    else charts[data.key] = new Chart(byId(`chart-${data.key}`), data);
  }
  byId("newest").hidden = !found.map;
  if (!found.map) return;
  byId("map").src = found.map.image;
  byId("caption").textContent = found.map.caption;
  byId("legend").replaceChildren(...found.map.legend.map((entry) => {
    const one = document.createElement("span"), colour = document.createElement("span");
    one.className = "class";
    colour.style.background = entry.colour;
    one.append(colour, entry.text);
    return one;
  }));
}

async function follow() {
  try {
    const answer = await fetch("data");
    const found = await answer.json();
    if (found.title !== undefined) show(found);
    if (found.over) return;
  } catch {
    byId("state").textContent += " – the watch has ended, and this page is no longer brought up to date";
    return;
  }
  setTimeout(follow, PAUSE);
}

follow();

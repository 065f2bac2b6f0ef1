'use strict';
// The page of a replay: one recording at a time is shown, at one of its moments.
const CONTACT = '#d62728', UNKNOWN = '#9aa0a6', OBSTACLE = '#5b7089', INK = '#2b3138';
const CONFIG = {displayModeBar: false, responsive: true};
const AXIS = {gridcolor: '#eceef1', zeroline: false, linecolor: '#c9ced4', ticks: 'outside',
  tickcolor: '#c9ced4'};
const BASE = {font: {family: 'system-ui, sans-serif', size: 12, color: INK}, showlegend: false,
  paper_bgcolor: 'white', plot_bgcolor: 'white'};
const ROW = 22, LEFT = 96, RIGHT = 14;
const data = JSON.parse(document.getElementById('data').textContent);
const at = id => document.getElementById(id);
const timeline = at('timeline'), scene = at('scene'), scrubber = at('scrubber'), view = at('view');
let shown = 0, recording = null, number = 0, timer = null;

function element(kind, text, className = '') {
  const made = document.createElement(kind);
  made.textContent = text;
  made.className = className;
  return made;
}

// Tables

function table(head, rows, onChoice = null) {
  const made = document.createElement('table');
  const top = made.createTHead().insertRow();
  head.forEach(text => top.append(element('th', text)));
  const body = made.createTBody();
  rows.forEach((cells, k) => {
    const row = body.insertRow();
    cells.forEach((text, column) => row.append(element('td', text, head[column] === 'verdict' ?
      `verdict ${text.replace(' ', '-')}` : '')));
    if (onChoice) {
      row.tabIndex = 0;
      row.onclick = () => onChoice(k);
      row.onkeydown = event => { if (event.key === 'Enter') onChoice(k); };
    }
  });
  return made;
}

function choose(rows, k) {
  rows.forEach((row, other) => row.classList.toggle('chosen', other === k));
}

function showTables() {
  const parts = [];
  for (const {title, note, head, rows, jumps} of recording.tables) {
    if (!rows.length) continue;
    const heading = element('h2', title);
    heading.append(element('small', [jumps ? 'click one to see where it is deepest' : '', note]
      .filter(Boolean).join('; ')));
    const wide = element('div', '', 'wide');
    wide.id = title.toLowerCase();
    wide.append(table(head, rows, jumps ? jump : null));
    parts.push(heading, wide);
  }
  at('tables').replaceChildren(...parts);
}

// Going from moment to moment

function states(k) {
  return recording.footprints.map(({name, colour, unknown, times, values}, footprint) => {
    const made = document.createElement('li');
    const label = element('b', `${name} `);
    label.style.setProperty('--colour', colour);
    const met = lasting(k).filter(one => one.footprint === footprint);
    const doubt = unknown.find(([first, end]) => first <= k && k < end);
    const next = times.findIndex(time => time >= recording.times[k]);
    const value = next < 0 ? null : values[next];
    const words = met.length ? 'in contact with ' + met.map(one => one.obstacle +
      (one.deepest === k ? ` (${one.words})` : '')).join(', ') :
      doubt ? `unknown: ${doubt[2]}` : value === null ? 'not known' :
        `clear, about ${value.toFixed(2)} m`;
    made.append(label, element('span', words, met.length ? 'collision' : doubt ? 'unknown' : ''));
    return made;
  });
}

function go(k, look = null) {
  const {times} = recording;
  if (!times.length) return;
  const before = number;
  number = Math.min(Math.max(k, 0), times.length - 1);
  const {obstacles, outlines} = shapesAt(number);
  const names = namesAt(number);
  const moving = [...obstacles, ...outlines, names];
  const {footprints} = recording;
  // A value for each trace, none for one that keeps its own.
  const none = obstacles.map(() => undefined);
  Plotly.update(scene, {x: moving.map(one => one.x), y: moving.map(one => one.y),
    text: moving.map(one => one.text),
    'line.dash': [...none, ...outlines.map(one => one.known ? 'solid' : 'dot')],
    fillcolor: [...none, ...outlines.map((one, i) => !one.known ? 'transparent' :
      fill(one.touches ? CONTACT : footprints[i].colour))],
    textposition: [...moving.slice(1).map(() => undefined), names.textposition],
  }, look || follow(before, number), moving.map((_, i) => i));
  Plotly.relayout(timeline, {'shapes[0].x0': times[number], 'shapes[0].x1': times[number]});
  scrubber.value = times[number];
  at('clock').textContent = `${times[number].toFixed(3)} s`;
  at('states').replaceChildren(...states(number));
  choose(document.querySelectorAll('#contacts tbody tr'),
    recording.contacts.indexOf(lasting(number)[0]));
}

function jump(k) {
  const contact = recording.contacts[k];
  stop();
  go(contact.deepest, lookAt(contact.footprint, contact.x, contact.y));
  choose(document.querySelectorAll('#contacts tbody tr'), k);
}

function goTo(time) {
  const {times} = recording;
  let nearest = 0;
  times.forEach((one, k) => {
    if (Math.abs(one - time) < Math.abs(times[nearest] - time)) nearest = k;
  });
  go(nearest);
}

function stop() {
  clearInterval(timer);
  timer = null;
  at('play').textContent = 'Play';
}

function play() {
  if (timer) { stop(); return; }
  const {times} = recording;
  if (number === times.length - 1) go(0);
  // As fast as it was, but no longer than 30 s.
  const speed = Math.max(1, (times[times.length - 1] - times[0]) / 30);
  const begun = performance.now() - 1000 * (times[number] - times[0]) / speed;
  at('play').textContent = 'Pause';
  timer = setInterval(() => {
    goTo(times[0] + speed * (performance.now() - begun) / 1000);
    if (number === times.length - 1) stop();
  }, 60);
}

// One of the recordings

function show(k) {
  stop();
  shown = k;
  recording = data.recordings[k];
  const {name, verdict, facts, problems, notes, times, footprints, begin, beginAt} = recording;
  at('name').textContent = name;
  at('verdict').textContent = verdict;
  at('verdict').className = verdict.replace(' ', '-');
  at('facts').textContent = facts.join(' · ');
  at('remarks').replaceChildren(...[...problems, ...notes].map(text => element('li', text)));
  choose(document.querySelectorAll('#index tbody tr'), k);
  showTables();
  at('drawing').hidden = !times.length;
  at('drawing').style.display = times.length ? '' : 'none';
  if (!times.length) return;
  view.replaceChildren(new Option('whole scene', ''),
    ...footprints.map((one, i) => new Option(`follow ${one.name}`, String(i))));
  scrubber.min = times[0];
  scrubber.max = times[times.length - 1];
  number = begin;
  drawTimeline();
  drawScene();
  go(begin, beginAt ? lookAt(...beginAt) : lookAtAll());
}

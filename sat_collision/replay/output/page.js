'use strict';
// The page of a replay: one recording at a time is shown, at one time of it.
const data = JSON.parse(document.getElementById('data').textContent);
const at = id => document.getElementById(id);
const scrubber = at('scrubber'), view = at('view');
let recording = null, now = 0, timer = null;

function element(kind, text = '', className = '') {
  const made = document.createElement(kind);
  made.textContent = text;
  made.className = className;
  return made;
}

// Tables

function table({head, rows}, onChoice = null) {
  const made = document.createElement('table');
  const top = made.createTHead().insertRow();
  const body = made.createTBody();
  head.forEach((text, column) => {
    const cell = element('th');
    const button = element('button', text);
    button.type = 'button';
    button.onclick = () => sortBy(made, column);
    cell.append(button);
    top.append(cell);
  });
  rows.forEach((cells, k) => {
    const row = body.insertRow();
    row.dataset.number = k;
    cells.forEach((text, column) => {
      const cell = element('td', text, head[column] === 'verdict' ?
        `verdict ${text.replace(' ', '-')}` : '');
      cell.dataset.head = head[column];
      row.append(cell);
    });
    if (onChoice) {
      row.tabIndex = 0;
      row.onclick = () => onChoice(k);
      row.onkeydown = event => { if (event.key === 'Enter') onChoice(k); };
    }
  });
  return made;
}

function sortBy(made, column) {
  const cells = [...made.tHead.rows[0].cells];
  const down = cells[column].getAttribute('aria-sort') === 'ascending';
  cells.forEach(cell => cell.removeAttribute('aria-sort'));
  cells[column].setAttribute('aria-sort', down ? 'descending' : 'ascending');
  const text = row => row.cells[column].textContent;
  const body = made.tBodies[0];
  const sorted = [...body.rows].sort((a, b) => {
    const [one, other] = [parseFloat(text(a)), parseFloat(text(b))];
    return isNaN(one) || isNaN(other) ? text(a).localeCompare(text(b)) : one - other;
  });
  body.append(...(down ? sorted.reverse() : sorted));
}

function choose(rows, k) {
  rows.forEach(row => row.classList.toggle('chosen', Number(row.dataset.number) === k));
}

function showTables() {
  const parts = [];
  for (const one of recording.tables) {
    if (!one.rows.length) continue;
    const heading = element('h2', one.title);
    const [hint, onChoice] = {
      'Contacts': ['choose one to see where it is deepest', jump],
      'Plans in contact': ['choose one to see it', jumpToPlan]}[one.title] || ['', null];
    heading.append(element('small', [hint, one.note].filter(Boolean).join('; ')));
    const wide = element('div', '', 'wide');
    wide.id = one.title.toLowerCase();
    wide.append(table(one, onChoice));
    parts.push(heading, wide);
  }
  at('tables').replaceChildren(...parts);
}

// The states at the present time

function lasting(time) {
  return recording.contacts.filter(one => one.first <= time && time <= one.last);
}

function separationAt({times, values}, time) {
  let k = times.findIndex(one => one > time);
  if (k < 0) k = times.length;
  const [one, other] = [values[k - 1], values[k]];
  if (one === undefined || one === null) return null;
  if (recording.asLive || other === undefined || other === null) return one;
  return one + (other - one) * (time - times[k - 1]) / (times[k] - times[k - 1]);
}

function stateOf(footprint, k, time) {
  const met = lasting(time).filter(one => one.footprint === k);
  if (met.length) {
    return ['in contact with ' + met.map(one => one.obstacle +
      (one.deepest === time ? ` (${one.words})` : '')).join(', '), 'collision'];
  }
  const unknown = footprint.unknown.find(([first, last]) => first <= time && time < last);
  if (unknown) return [unknown[2], 'unknown'];
  const value = separationAt(footprint, time);
  return value === null ? ['clear', ''] : [`clear, about ${value.toFixed(2)} m`, ''];
}

function showStates() {
  const states = recording.footprints.map((one, k) => stateOf(one, k, now));
  at('states').replaceChildren(...recording.footprints.map(({name, colour}, k) => {
    const made = document.createElement('li');
    const swatch = element('span', '', 'swatch');
    swatch.style.setProperty('--colour', colour);
    made.append(swatch, element('b', `${name} `), element('span', ...states[k]));
    return made;
  }));
  const said = recording.footprints.map(({name}, k) => `${name} ${states[k][0]}`);
  const text = [`${now.toFixed(3)} s`, ...said.slice(0, 3)].join(', ');
  [scrubber, timeline].forEach(one => one.setAttribute('aria-valuetext', text));
  timeline.setAttribute('aria-valuenow', now);
}

// Moving in time

function go(time, keepLink = false) {
  const {start, end, times} = recording;
  if (!times.length) return;
  const before = now;
  now = Math.min(Math.max(time, start), end);
  follow(before, now);
  drawScene();
  moveCursor();
  scrubber.value = now;
  at('clock').textContent = `${now.toFixed(3)} s`;
  showStates();
  choose(document.querySelectorAll('#contacts tbody tr'),
    recording.contacts.indexOf(lasting(now)[0]));
  if (!keepLink) link();
}

function link() {
  const parts = data.recordings.length > 1 ? [`r=${data.recordings.indexOf(recording) + 1}`] : [];
  history.replaceState(null, '', '#' + [...parts, `t=${now.toFixed(3)}`].join('&'));
}

function jump(k) {
  const contact = recording.contacts[k];
  stop();
  now = contact.deepest;
  lookAt(contact.footprint, contact.x, contact.y);
  go(now);
  choose(document.querySelectorAll('#contacts tbody tr'), k);
}

function jumpToPlan(k) {
  const {first, way, outline} = recording.plans[k];
  stop();
  lookAtAll();
  if (way.length) {
    const {x, y, size} = bounds([...way, ...outline]);
    fit(x, y, 0.6 * size, 0.6 * size);
  }
  go(first);
}

function stop() {
  if (timer) link();
  cancelAnimationFrame(timer);
  timer = null;
  at('play').textContent = 'Play';
}

function play() {
  if (timer) { stop(); return; }
  const {start, end} = recording;
  if (now >= end) go(start);
  // In real time, or faster if that would take more than 30 s.
  const speed = Math.max(1, (end - start) / 30);
  const begun = performance.now() - 1000 * (now - start) / speed;
  at('play').textContent = 'Pause';
  const step = () => {
    timer = requestAnimationFrame(step);
    go(start + speed * (performance.now() - begun) / 1000, true);
    if (now >= end) stop();
  };
  timer = requestAnimationFrame(step);
}

function onKey(event) {
  const {start, end} = recording;
  const step = (end - start) / 400;
  const target = {ArrowLeft: now - step, ArrowDown: now - step, ArrowRight: now + step,
    ArrowUp: now + step, PageDown: now - 20 * step, PageUp: now + 20 * step, Home: start,
    End: end}[event.key];
  if (target === undefined) return;
  event.preventDefault();
  stop();
  go(target);
}

// One of the recordings

function show(k, time = null) {
  stop();
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
  if (!times.length) return;
  view.replaceChildren(new Option('whole scene', ''),
    ...footprints.map((one, i) => new Option(`follow ${one.name}`, String(i))));
  for (const [key, value] of [['min', recording.start], ['max', recording.end]]) {
    scrubber[key] = value;
    timeline.setAttribute(`aria-value${key}`, value);
  }
  decode(recording);
  showAllTimes();
  now = begin;
  if (beginAt && time === null) lookAt(...beginAt); else lookAtAll();
  go(time === null ? begin : time, true);
}

function showLinked() {
  const parts = new URLSearchParams(location.hash.slice(1));
  const number = Math.min(Math.max(Number(parts.get('r')) || 1, 1), data.recordings.length);
  const time = parseFloat(parts.get('t'));
  show(number - 1, isNaN(time) ? null : time);
}

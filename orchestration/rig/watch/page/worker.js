// One for all tabs: asks `ppy rig watch` for the stream, and gives the answer to the tabs that wait for it. A tab that
// is frozen or closed asks for nothing, so nothing is kept for it.

import { pause, request } from "./stream.js";

let waiting = [];

self.onconnect = ({ ports: [port] }) => {
  port.onmessage = ({ data }) => waiting.push({ port, after: data, since: performance.now() });
};

async function answer(after, tabs) {
  const sent = performance.now();
  const update = await request(after);
  for (const { port, since } of tabs) port.postMessage({ update, waited: sent - since });
}

async function serve() {
  for (;;) {
    const tabs = waiting;
    waiting = [];
    const numbers = [...new Set(tabs.map(tab => tab.after))];
    await Promise.all(numbers.map(after => answer(after, tabs.filter(tab => tab.after === after))));
    await pause();
  }
}

serve();

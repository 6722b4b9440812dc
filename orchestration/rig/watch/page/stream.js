// The stream of items of `ppy rig watch`. A request is answered at once and held by nobody, so that it never keeps one
// of the six connections that a browser has for all its tabs from a stop.

const PATIENCE = 700; // ms that the server may take, so that a page says within a second that it does not answer
const WORKER_PATIENCE = 3000; // ms that the worker may take, which waits for the server itself
const PERIOD = 100; // ms between two requests

export const pause = () => new Promise(done => setTimeout(done, PERIOD));

// What is newer than the item of a number; of -1 all there is. Null if there is no answer in time.
export async function request(after) {
  try {
    const answer = await fetch(`/stream?after=${after}`, { priority: "low", signal: AbortSignal.timeout(PATIENCE) });
    return answer.ok ? await answer.json() : null;
  } catch {
    return null;
  }
}

// Gives every update to `take`, with when it was asked for, and null where there was no answer. All tabs ask one worker,
// which asks the server; where there is no worker, or it does not answer, a tab asks the server itself.
export async function follow(instance, take) {
  let worker = connect(instance);
  let serial = -1;
  for (;;) {
    let asked = performance.now();
    let answer = worker ? await askWorker(worker, serial) : undefined;
    if (answer === undefined) {
      worker = null;
      await pause();
      asked = performance.now();
      answer = { waited: 0, update: await request(serial) };
    }
    serial = answer.update?.serial ?? serial;
    take(answer.update, asked + answer.waited);
  }
}

// A worker of its own for every `ppy rig watch`, for one of an earlier version may still live in a forgotten tab.
function connect(instance) {
  try {
    const { port } = new SharedWorker("/worker.js", { type: "module", name: instance });
    port.start();
    return port;
  } catch {
    return null; // a browser that has none, or does not allow it
  }
}

function askWorker(port, serial) {
  return new Promise(done => {
    const timer = setTimeout(() => done(undefined), WORKER_PATIENCE);
    port.onmessage = ({ data }) => {
      clearTimeout(timer);
      done(data);
    };
    port.postMessage(serial);
  });
}

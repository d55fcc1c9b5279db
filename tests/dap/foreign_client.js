// Debugs a program with Microsoft's client for debug adapters: foreign_client.js MODULE PORT PROGRAM LINE. What it saw is
// printed as JSON.
const [module_, port, program, line] = process.argv.slice(2);
const { DebugClient } = require(module_);

async function main() {
  const client = new DebugClient("node", "none", "iecst");
  client.defaultTimeout = 60000;
  await client.start(Number(port));
  await client.hitBreakpoint({ program }, { path: program, line: Number(line) });
  const threadId = 1;
  const { stackFrames } = (await client.stackTraceRequest({ threadId })).body;
  const frameId = stackFrames[0].id;
  const { scopes } = (await client.scopesRequest({ frameId })).body;
  const seen = {};
  for (const { name, variablesReference } of scopes.slice(0, 2)) {
    const { variables } = (await client.variablesRequest({ variablesReference })).body;
    seen[name] = Object.fromEntries(variables.map((v) => [v.name, v.value]));
  }
  const value = (await client.evaluateRequest({ expression: "step * 10", frameId })).body.result;
  await Promise.all([client.waitForEvent("stopped"), client.stepInRequest({ threadId })]);
  const inside = (await client.stackTraceRequest({ threadId })).body.stackFrames[0];
  await Promise.all([client.waitForEvent("stopped"), client.stepOutRequest({ threadId })]);
  await client.disconnectRequest({});
  const calls = stackFrames.map((f) => [f.name, f.line]);
  console.log(JSON.stringify({ calls, seen, value, inside: [inside.name, inside.line] }));
  process.exit(0);
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});

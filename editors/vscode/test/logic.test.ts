import assert from 'node:assert/strict';
import { chmodSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import * as path from 'node:path';
import { test } from 'node:test';

import { isDuration, missingFor, stepOf, taskArguments } from '../src/actions';
import { filterFor, findPythonTests, findTests, junitOutcomes, outcomesOf } from '../src/discover';
import { Lines } from '../src/lines';
import { commandsIn, documentOf, environmentOf, findTool, linkIn, projectOf, pythonOf, run, runJson, ToolError } from '../src/tool';
import { childrenOf, entriesOf, literal, nameAt, qualified, readingOf } from '../src/values';

void test('the configured plctool comes first, then that of the workspace, then that of the PATH', () => {
  const exists = (file: unknown): boolean => file === path.join('/plant', 'venv', 'bin', 'plctool');
  assert.equal(findTool('/opt/plctool', ['/plant'], exists), '/opt/plctool');
  assert.equal(findTool('', ['/other', '/plant'], exists), path.join('/plant', 'venv', 'bin', 'plctool'));
  assert.equal(findTool('', ['/other'], exists), 'plctool');
});

void test('the Python of the tests is the one beside plctool', () => {
  assert.equal(pythonOf('/p/.venv/bin/plctool', () => true), '/p/.venv/bin/python');
  assert.equal(pythonOf('plctool', () => true), 'python3');
});

void test('a link of the settings goes into the environment', () => {
  assert.deepEqual(environmentOf('tcp:10.0.0.2'), { PLC_LINK: 'tcp:10.0.0.2' });
  assert.deepEqual(environmentOf(''), {});
});

void test('commands are read from the help', () => {
  const help = 'commands:\n  COMMAND\n    build     compile a program to an image\n    export-itf\n              write a C header\n';
  assert.deepEqual([...commandsIn(help)], ['build', 'export-itf']);
});

void test('the project of a file is the nearest plc.toml within the workspace', () => {
  const exists = (file: unknown): boolean => file === '/w/plant/plc.toml' || file === '/plc.toml';
  assert.equal(projectOf('/w/plant/src/main.st', '/w', exists), '/w/plant');
  assert.equal(projectOf('/w/other/main.st', '/w', exists), undefined);
});

void test('the link of a project is read from its plc.toml', () => {
  assert.equal(linkIn('sources = []\n# link = "no"\nlink = "tcp:10.0.0.2" # there\n'), 'tcp:10.0.0.2');
  assert.equal(linkIn("link = 'serial:/dev/ttyS0'"), 'serial:/dev/ttyS0');
  assert.equal(linkIn('sources = []'), '');
});

void test('a document with an error is raised with its message', () => {
  const ran = { stdout: '{"error": {"code": "open", "message": "no port"}}', stderr: '', code: 2 };
  assert.throws(() => documentOf(ran), new ToolError('no port'));
  assert.throws(() => documentOf({ stdout: '', stderr: 'Traceback', code: 1 }), new ToolError('Traceback'));
  assert.throws(() => documentOf({ stdout: '', stderr: '', code: 1 }), /exit code 1/);
});

void test('a plctool that is not installed is named, with what to do', async () => {
  const missing = { path: '/nowhere/plctool', environment: {} };
  await assert.rejects(run(missing, ['--help'], tmpdir()), /pip install plctool/);
});

void test('plctool gets its arguments and environment as they are', async () => {
  const folder = mkdtempSync(path.join(tmpdir(), 'plctool-'));
  try {
    const script = path.join(folder, 'plctool');
    writeFileSync(script, '#!/bin/sh\nprintf \'{"args": "%s", "link": "%s"}\' "$1 $2 $3" "$PLC_LINK"\nexit 1\n');
    chmodSync(script, 0o755);
    const tool = { path: script, environment: environmentOf('tcp:1') };
    assert.deepEqual(await runJson(tool, ['read', 'a; rm b'], folder), { args: 'read a; rm b --json', link: 'tcp:1' });
  } finally {
    rmSync(folder, { recursive: true });
  }
});

void test('commands start plctool for their target', () => {
  assert.deepEqual(stepOf('check', 'p').args, ['check', 'p']);
  assert.deepEqual(stepOf('simulate', 'p', 'T#1m').args, ['run', '--time', 'T#1m', 'p']);
  assert.deepEqual(stepOf('onlineChange', 'p').args, ['flash', '--online-change', 'p']);
  assert.deepEqual(taskArguments('check', 'a.st', ['--werror']), ['check', '--werror', 'a.st']);
  assert.deepEqual(taskArguments('build', undefined, []), ['build']);
});

void test('an online change needs a plctool that has it', () => {
  assert.match(missingFor('onlineChange', 'usage: plctool flash [--force]') ?? '', /no online change/);
  assert.equal(missingFor('onlineChange', '  --online-change'), undefined);
  assert.equal(missingFor('flash', ''), undefined);
});

void test('durations are checked before a simulation', () => {
  for (const right of ['T#10s', 't#1m30s', 'TIME#1.5h', 'LT#1d_2h']) assert.ok(isDuration(right), right);
  for (const wrong of ['10', 'T#', '10s', 'T#10', 'T#1s; rm']) assert.ok(!isDuration(wrong), wrong);
});

void test('lines are put together from pieces', () => {
  const lines = new Lines();
  assert.deepEqual(lines.add('{"a"'), []);
  assert.deepEqual(lines.add(': 1}\r\n{}\n\n{"b'), ['{"a": 1}', '{}']);
  assert.deepEqual(lines.add('": 2}\n'), ['{"b": 2}']);
});

const LINE =
  '{"time_s": 0.5, "values": {"Main.lamp": true, "Main.timer": {"IN": true, "PT": "T#500ms"}, "Main.list": [1, 2]},' +
  ' "consistent": true, "forced": ["Main.lamp", "Main.timer.IN"]}';

void test('a line of watch is a tree of values that may be forced', () => {
  const reading = readingOf(LINE);
  const [lamp, timer, list, other] = entriesOf(['Main.lamp', 'Main.timer', 'Main.list', 'Main.other'], reading);
  assert.ok(lamp && timer && list && other);
  assert.equal(literal(lamp.value), 'TRUE');
  assert.ok(lamp.isForced);
  assert.equal(literal(other.value), '');
  const members = childrenOf(timer, reading);
  assert.deepEqual(members.map((entry) => entry.name), ['Main.timer.IN', 'Main.timer.PT']);
  assert.ok(members[0]?.isForced);
  assert.equal(literal(members[1]?.value ?? null), 'T#500ms');
  assert.deepEqual(childrenOf(list, reading).map((entry) => entry.name), [undefined, undefined]);
});

void test('below a pattern is what it matches', () => {
  const reading = readingOf(LINE);
  const [pattern] = entriesOf(['main.l*'], reading);
  assert.ok(pattern?.hasChildren);
  assert.deepEqual(childrenOf(pattern, reading).map((entry) => entry.name), ['Main.lamp', 'Main.list']);
});

void test('a line of watch with an error is raised, other output is ignored', () => {
  assert.throws(() => readingOf('{"error": {"message": "There is no variable x."}}'), /no variable x/);
  assert.equal(readingOf('plctool: the link is serial'), undefined);
  assert.equal(readingOf('{"gap": 1}'), undefined);
});

void test('the name at the cursor gets the program it is in', () => {
  assert.equal(nameAt('    pump.speed[3] := 1;', 6), 'pump.speed[3]');
  assert.equal(nameAt('x := 1;', 5), undefined);
  assert.equal(qualified('lamp', ['PROGRAM Main', 'VAR', 'lamp']), 'Main.lamp');
  assert.equal(qualified('lamp', ['PROGRAM Main', 'END_PROGRAM', 'FUNCTION_BLOCK B']), 'lamp');
  assert.equal(qualified('g', ['VAR_GLOBAL']), 'g');
});

void test('TEST blocks are found, but not in comments and strings', () => {
  const source = "(* TEST 'no' (* TEST 'no' *) *)\n// TEST 'no'\nTEST 'it$'s $24'\nx := 'TEST ';\nEND_TEST\ntest \"b\" {TEST 'no'}";
  assert.deepEqual(findTests(source), [
    { name: "it's $", line: 2 },
    { name: 'b', line: 5 },
  ]);
});

void test('tests of pytest are functions, and methods of its classes', () => {
  const source = 'import x\ndef test_a():\n  def test_inner(): pass\nclass TestB:\n    async def test_c(self): pass\nclass Other:\n    def test_d(self): pass\n';
  assert.deepEqual(findPythonTests(source), [
    { name: 'test_a', line: 1 },
    { name: 'TestB::test_c', line: 4 },
  ]);
});

void test('outcomes of plctool test have the line and values of a failure', () => {
  const failure = { kind: 'ASSERT_EQ', text: 'expected 2, got 1', message: 'count', line: 5, actual: 1, expected: 2 };
  const [failed, passed] = outcomesOf({
    tests: [
      { name: 'a', file: 'src/t.st', seconds: 0.002, passed: false, failure },
      { name: 'b', file: 'src/t.st', seconds: 0, passed: true, failure: null },
    ],
  });
  assert.deepEqual(failed, {
    name: 'a',
    file: 'src/t.st',
    passed: false,
    milliseconds: 2,
    message: 'ASSERT_EQ: expected 2, got 1 count',
    line: 4,
    actual: '1',
    expected: '2',
  });
  assert.equal(passed?.passed, true);
});

void test('one test is chosen by its name, several run all of their project', () => {
  assert.deepEqual(filterFor(['a']), ['-k', 'a']);
  assert.deepEqual(filterFor(['a', 'b']), []);
});

void test('a report of pytest is read, one with parameters as one test', () => {
  const xml =
    '<testsuite><testcase classname="tests.test_a.TestB" name="test_c[1]" time="0.5"/>' +
    '<testcase classname="tests.test_a.TestB" name="test_c[2]" time="0.5"><failure message="assert 1 &lt; 0">a&#10;b</failure></testcase>' +
    '<testcase classname="tests.test_a" name="test_d" time="0" /></testsuite>';
  const found = junitOutcomes(xml);
  assert.deepEqual([...found.keys()], ['TestB::test_c', 'test_d']);
  assert.equal(found.get('TestB::test_c')?.passed, false);
  assert.equal(found.get('TestB::test_c')?.milliseconds, 1000);
  assert.equal(found.get('TestB::test_c')?.message, 'assert 1 < 0\na\nb');
  assert.equal(found.get('test_d')?.passed, true);
});

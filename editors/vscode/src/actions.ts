// What the commands of the palette and the tasks start. Without VS Code.

export type Action = 'check' | 'build' | 'flash' | 'onlineChange' | 'simulate';
export const TASKS = ['check', 'build', 'test', 'fmt'] as const;
export type TaskName = (typeof TASKS)[number];

export interface Step {
  readonly title: string;
  readonly args: readonly string[];
}

/** The arguments of plctool for a command. `target` is a project, a folder or a file, `time` a duration as in ST. */
export function stepOf(action: Action, target: string, time = 'T#10s'): Step {
  switch (action) {
    case 'check':
      return { title: 'check', args: ['check', target] };
    case 'build':
      return { title: 'build', args: ['build', target] };
    case 'flash':
      return { title: 'flash', args: ['flash', target] };
    case 'onlineChange':
      return { title: 'online change', args: ['flash', '--online-change', target] };
    case 'simulate':
      return { title: 'simulate', args: ['run', '--time', time, target] };
  }
}

/** Whether plctool has what a command needs: undefined, or a message that says what is missing. */
export function missingFor(action: Action, helpOfFlash: string): string | undefined {
  if (action !== 'onlineChange' || helpOfFlash.includes('--online-change')) return undefined;
  return 'This plctool has no online change; flash the program instead, or update plctool.';
}

export function taskArguments(command: TaskName, project: string | undefined, args: readonly string[]): string[] {
  return [command, ...args, ...(project === undefined || project === '' ? [] : [project])];
}

/** True for a duration as ST writes it, which `plctool run --time` takes. */
export function isDuration(text: string): boolean {
  return /^(L?TIME|L?T)#(\d[\d_]*(\.\d+)?(d|h|ms|m|s|us|ns)_?)+$/i.test(text);
}

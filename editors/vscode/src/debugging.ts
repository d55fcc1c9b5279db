// The debug adapter, `plctool dap`, and the configuration of a program without launch.json.

import * as vscode from 'vscode';

import { activeFile, folderOf, settings, target, tool } from './setup';

export function registerDebugging(hasAdapter: boolean): vscode.Disposable {
  return vscode.Disposable.from(
    vscode.debug.registerDebugConfigurationProvider('plctool', {
      resolveDebugConfiguration: (folder, configuration) => resolved(folder, configuration, hasAdapter),
    }),
    vscode.debug.registerDebugAdapterDescriptorFactory('plctool', {
      createDebugAdapterDescriptor: (session) => {
        const { path, environment } = tool();
        const cwd = session.workspaceFolder?.uri.fsPath ?? folderOf();
        const options = { env: { ...environment }, ...(cwd === undefined ? {} : { cwd }) };
        return new vscode.DebugAdapterExecutable(path, ['dap'], options);
      },
    }),
  );
}

function resolved(
  folder: vscode.WorkspaceFolder | undefined,
  configuration: vscode.DebugConfiguration,
  hasAdapter: boolean,
): vscode.DebugConfiguration | undefined {
  if (!hasAdapter) {
    void vscode.window.showErrorMessage('This plctool has no debug adapter; update it.');
    return undefined;
  }
  const program = target(activeFile())?.path ?? folder?.uri.fsPath;
  const link = settings().get<string>('link', '');
  const isAttached = configuration.request === 'attach';
  return {
    ...(program === undefined ? {} : { program }),
    ...(isAttached && link !== '' ? { link } : {}),
    ...configuration,
    type: 'plctool',
    request: isAttached ? 'attach' : 'launch',
    name: configuration.name === '' ? 'Debug in the simulator' : configuration.name,
  };
}

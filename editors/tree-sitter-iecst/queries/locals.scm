[
  (function)
  (function_block)
  (program)
  (class)
  (interface)
  (namespace)
  (method)
  (accessor)
  (single_accessor)
  (action)
  (test)
  (setup)
] @local.scope

(variable_declaration name: (identifier) @local.definition.var)
(variable_block
  ["VAR_INPUT" "VAR_OUTPUT" "VAR_IN_OUT"]
  (variable_declaration name: (identifier) @local.definition.parameter))
(structure_type (variable_declaration name: (identifier) @local.definition.field))
(enumerator name: (identifier) @local.definition.constant)
(type_declaration name: (identifier) @local.definition.type)
(function_block name: (identifier) @local.definition.type)
(class name: (identifier) @local.definition.type)
(interface name: (identifier) @local.definition.type)
(program name: (identifier) @local.definition.type)
(function name: (identifier) @local.definition.function)
(method name: (identifier) @local.definition.method)
(action name: (identifier) @local.definition.method)
(property name: (identifier) @local.definition.field)
(label name: (identifier) @local.definition)
(step name: (identifier) @local.definition)
(namespace name: (named_type (identifier) @local.definition.namespace))

(identifier) @local.reference

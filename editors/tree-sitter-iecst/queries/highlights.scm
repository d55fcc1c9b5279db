; Where several patterns match a node, the last one counts.

(identifier) @variable
(variable_declaration name: (identifier) @variable)
(member_expression member: (identifier) @variable.member)
(member_initializer name: (identifier) @variable.member)
(structure_type (variable_declaration name: (identifier) @variable.member))
(input_argument name: (identifier) @variable.parameter)
(output_argument name: (identifier) @variable.parameter)
(enumerator name: (identifier) @constant)
(variable_block
  (qualifier "CONSTANT")
  (variable_declaration name: (identifier) @constant))
((identifier) @variable.builtin
  (#any-of? @variable.builtin "THIS" "SUPER" "this" "super" "This" "Super"))

(call_expression function: (identifier) @function.call)
(call_expression function: (member_expression member: (identifier) @function.method.call))
(call_expression function: (global_name name: (identifier) @function.call))
(function name: (identifier) @function)
(method name: (identifier) @function.method)
(action name: (identifier) @function.method)
(property name: (identifier) @property)
(single_accessor name: (identifier) @property)
(step name: (identifier) @label)
(transition name: (identifier) @label)
(steps (identifier) @label)
(label name: (identifier) @label)
(jump_statement label: (identifier) @label)

(named_type (identifier) @type)
(type_declaration name: (identifier) @type.definition)
(function_block name: (identifier) @type.definition)
(class name: (identifier) @type.definition)
(interface name: (identifier) @type.definition)
(program name: (identifier) @type.definition)
(namespace name: (named_type (identifier) @module))
(using (named_type (identifier) @module))
(configuration name: (identifier) @module)
(resource name: (identifier) @module)
(task name: (identifier) @label)
(program_instance task: (identifier) @label)
(block_with_task . (identifier) @variable "WITH" (identifier) @label)
((named_type (identifier) @type.builtin)
  (#any-of? @type.builtin
    "BOOL" "BYTE" "WORD" "DWORD" "LWORD" "SINT" "INT" "DINT" "LINT" "USINT" "UINT" "UDINT" "ULINT" "REAL" "LREAL"
    "TIME" "LTIME" "DATE" "TOD" "DT" "LDATE" "LTOD" "LDT" "CHAR" "WCHAR" "TIME_OF_DAY" "LTIME_OF_DAY"
    "DATE_AND_TIME" "LDATE_AND_TIME" "__XWORD" "__UXINT" "__XINT" "XWORD" "UXINT" "XINT" "bool" "byte" "word"
    "dword" "lword" "sint" "int" "dint" "lint" "usint" "uint" "udint" "ulint" "real" "lreal" "time" "ltime" "date"
    "tod" "dt" "ldate" "ltod" "ldt" "char" "wchar" "time_of_day" "ltime_of_day" "date_and_time" "ldate_and_time"
    "__xword" "__uxint" "__xint" "xword" "uxint" "xint"))
["STRING" "WSTRING"] @type.builtin

(number) @number
(typed_literal) @number
(string) @string
(boolean) @boolean
(null) @constant.builtin
(address) @constant.macro
(comment) @comment @spell
(pragma) @attribute

[
  ":=" "=>" "?=" "REF=" "=" "<>" "<" ">" "<=" ">=" "+" "-" "*" "/" "**" "&" "^" ".."
] @operator
(assignment operator: (operator) @operator)
["(" ")" "[" "]"] @punctuation.bracket
[";" ":" "," "."] @punctuation.delimiter

(binary_expression operator: ["AND" "AND_THEN" "OR" "OR_ELSE" "XOR" "MOD"] @keyword.operator)
"NOT" @keyword.operator

["IF" "THEN" "ELSIF" "ELSE" "END_IF" "CASE" "OF" "END_CASE"] @keyword.conditional
["FOR" "TO" "BY" "DO" "END_FOR" "WHILE" "END_WHILE" "REPEAT" "UNTIL" "END_REPEAT" "EXIT" "CONTINUE"] @keyword.repeat
["RETURN" "JMP"] @keyword.return
["__TRY" "__CATCH" "__FINALLY" "__ENDTRY"] @keyword.exception
["USING"] @keyword.import
[
  "FUNCTION" "END_FUNCTION" "FUNCTION_BLOCK" "END_FUNCTION_BLOCK" "PROGRAM" "END_PROGRAM" "METHOD" "END_METHOD"
  "PROPERTY" "PROPERTY_GET" "PROPERTY_SET" "END_PROPERTY" "GET" "END_GET" "SET" "END_SET" "ACTION" "END_ACTION"
  "TEST" "END_TEST" "SETUP" "END_SETUP" "TEARDOWN" "END_TEARDOWN" "MOCK" "MOCK_FUNCTION" "RETURNS"
] @keyword.function
[
  "TYPE" "END_TYPE" "STRUCT" "END_STRUCT" "UNION" "END_UNION" "CLASS" "END_CLASS" "INTERFACE" "END_INTERFACE"
  "ARRAY" "POINTER" "REFERENCE" "REF_TO" "EXTENDS" "IMPLEMENTS"
] @keyword.type
(array_type "OF" @keyword.type)
(pointer_type "TO" @keyword.type)
[
  "VAR" "VAR_INPUT" "VAR_OUTPUT" "VAR_IN_OUT" "VAR_TEMP" "VAR_STAT" "VAR_EXTERNAL" "VAR_INST" "VAR_GLOBAL" "VAR_CONFIG"
  "VAR_ACCESS" "END_VAR" "NAMESPACE" "END_NAMESPACE" "CONFIGURATION" "END_CONFIGURATION" "RESOURCE" "ON" "END_RESOURCE"
  "TASK" "WITH" "INITIAL_STEP" "STEP" "END_STEP" "TRANSITION" "FROM" "END_TRANSITION"
] @keyword
(transition "TO" @keyword)
[(qualifier) (modifier) "OVERLAP" "AT" "R_EDGE" "F_EDGE" "READ_ONLY" "READ_WRITE"] @keyword.modifier
